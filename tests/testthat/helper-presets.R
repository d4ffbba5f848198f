# The agent of a row of agent_presets().
preset_agent <- function(row) {
  preset <- preset_settings(row)
  do.call(paste0("agent_", preset$agent), preset_arguments(preset))
}
