"""The Atari games' ids in OpenAI's Gym, and their ids today."""

from __future__ import annotations

import re

# The games of Gym 0.21, whose ids appear in classic scripts. Gymnasium does not know these ids.
_GAMES = """
    Adventure AirRaid Alien Amidar Assault Asterix Asteroids Atlantis BankHeist BattleZone
    BeamRider Berzerk Bowling Boxing Breakout Carnival Centipede ChopperCommand CrazyClimber
    Defender DemonAttack DoubleDunk ElevatorAction Enduro FishingDerby Freeway Frostbite Gopher
    Gravitar Hero IceHockey Jamesbond JourneyEscape Kangaroo Krull KungFuMaster
    MontezumaRevenge MsPacman NameThisGame Phoenix Pitfall Pong Pooyan PrivateEye Qbert
    Riverraid RoadRunner Robotank Seaquest Skiing Solaris SpaceInvaders StarGunner Tennis
    TimePilot Tutankham UpNDown Venture VideoPinball WizardOfWor YarsRevenge Zaxxon
"""
_BY_LOWER_CASE = {game.lower(): game for game in _GAMES.split()}

_CLASSIC = re.compile(r"(\w+?)(-ram)?(?:Deterministic|NoFrameskip)?(?:-v\d+)?", re.IGNORECASE)


def classic_game(name: str) -> tuple[str, bool] | None:
    """Return today's id for a classic Atari id, and whether it observes the game's memory.

    Args:
        name: such as ``Breakout-v0`` or ``Pong-ramNoFrameskip-v4``.

    Returns:
        Such as ``("ALE/Pong-v5", True)``; None for any other id.
    """
    match = _CLASSIC.fullmatch(name)
    if match is None or (game := _BY_LOWER_CASE.get(match[1].lower())) is None:
        return None
    return f"ALE/{game}-v5", match[2] is not None
