"""Train with Stable-Baselines3, as a program of its own: ``python -m gym_server.sb3 job.json``.

R's ``learn_sb3()`` runs it as a child process. The job is a JSON file. What comes of it are files
in the job's folder: the tables that Stable-Baselines3's logger writes, the policy, and
``result.json``. The program ends at the next step when its standard input is closed, which also
happens if R is killed.
"""
