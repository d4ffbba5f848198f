"""A server for each user, behind one address.

The front process reads the head of a connection's first request, finds the user by the token,
starts that user's own server if it does not run, and hands the open connection over to it. Each
server checks the token of every request itself, so the front decides only who gets a connection.

It is one loop of one thread. It imports nothing but Python's standard library, because everybody
who reaches its port talks to it before showing a token.
"""
