# The trainings of the table of solved environments: the target that is reported and its source, the
# target at which training stops (above it, so that the final evaluation reaches it), and the number
# of seeds. The settings are the presets of the package (agent_presets()).
#
# Settings were tried on the seeds 1 to 99. The first choice of them is reported on the seeds from
# 1001 on. Where it missed its goal, or was slow, and another one was chosen, again on the seeds 1
# to 99, that is reported on the seeds from 2001 on, and so on; the rows of the first choice stay in
# the table.

solve_jobs <- utils::read.csv(text = "
env_id,kwargs,method,target,target_source,train_target,choice,seeds
CartPole-v1,,ars,475,registered,490,1,20
CartPole-v1,,ppo,475,registered,490,2,20
CartPole-v1,,reinforce,475,registered,490,1,20
CartPole-v1,,dqn,475,registered,490,1,20
Acrobot-v1,,ars,-100,registered,-90,1,20
Acrobot-v1,,ppo,-100,registered,-90,1,20
Acrobot-v1,,dqn,-100,registered,-90,1,20
MountainCar-v0,,dqn,-110,registered,-105,1,10
MountainCarContinuous-v0,,ars,90,registered,92,1,20
LunarLander-v3,continuous,ars,200,registered,220,1,20
LunarLander-v3,continuous,ppo,200,registered,215,1,20
LunarLander-v3,,ars,200,registered,215,1,20
LunarLander-v3,,ppo,200,registered,215,1,20
LunarLander-v3,,dqn,200,registered,215,1,10
Swimmer-v5,,cem,325,paper (registered 360),335,3,20
HalfCheetah-v5,,ars,3430,paper (registered 4800),3500,1,10
HalfCheetah-v5,,ppo,3430,paper (registered 4800),3500,1,3
Pendulum-v1,,cem,-200,ours,-155,2,10
Pendulum-v1,,ppo,-200,ours,-155,3,20
Hopper-v5,,ars,3120,paper (registered 3800),3250,1,1
Hopper-v5,,ppo,3120,paper (registered 3800),3250,1,3
BipedalWalker-v3,,ars,300,registered,305,1,1
BipedalWalker-v3,,ppo,300,registered,305,1,10
", strip.white = TRUE, na.strings = "NA", colClasses = c(kwargs = "character"))

# What a job is told apart from others by. Searches of one environment are one: the first choices of
# Swimmer-v5 were of another method than the last one.
job_key <- function(rows) {
  paste(rows$env_id, rows$kwargs, ifelse(rows$method %in% c("ars", "cem"), "search", rows$method))
}

first_seed <- function(job) 1000L * job$choice + 1L

# The environment's own arguments of a job, by their names in the table.
job_kwargs <- function(name) if (nzchar(name)) stats::setNames(list(TRUE), name) else list()
