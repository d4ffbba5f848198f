"""The routes of monitors, which record episodes."""

from __future__ import annotations

from gym_server.api import env_fields
from gym_server.api.calls import Call
from gym_server.api.routing import INSTANCE, RouteBlueprint
from gym_server.protocol.fields import BOOLEAN, TEXT, Field

bp = RouteBlueprint("monitors")


@bp.declare(
    "POST",
    INSTANCE + "monitor/start/",
    Field("directory", TEXT, required=True),
    Field("force", BOOLEAN),
    Field("resume", BOOLEAN),
    Field("video_callable", env_fields.VIDEO_CALLABLE),
)
def env_monitor_start(call: Call) -> None:
    """Record the episodes that start from now on."""
    fields = call.fields
    call.instance.start_monitor(
        call.services.monitor_root,
        fields["directory"],
        bool(fields["force"]),
        bool(fields["resume"]),
        fields["video_callable"] or 0,
    )


@bp.declare("POST", INSTANCE + "monitor/close/")
def env_monitor_close(call: Call) -> None:
    """Finish the monitor's files; without a monitor, do nothing."""
    call.instance.close_monitor()
