"""A small HTTP/1.1 server; ``Application`` is all it knows about its application.

Why it exists:

- Speed. The thread that waits for a client's request also answers it. Other servers that run on
  Windows, macOS and Linux hand each request to another thread. Microseconds per request (and
  requests per second) on one kept-alive connection, medians of 11 interleaved runs of 1,000
  requests on two busy cores:

      ==================  ===================  =====================
      application         this server          waitress 3.0.2
      ==================  ===================  =====================
      a bare one          24 (42,000)          146 (6,800)
      Flask, one route    139 (7,200)          246 (4,100)
      ==================  ===================  =====================

- A stop loses no response: ``Server.run()`` answers all requests that have arrived before it
  returns.
- A response may take over the socket, to speak another protocol.

It serves people who trust each other: who is known to the application may use a connection, which
has a thread of its own, as slowly as they like. Others have 20 seconds, and make room for new ones.

What it does not support: TLS, HTTP/2, compression, files, chunked responses (a response is sent
when it is complete), several processes. Put a reverse proxy in front of it for those.
"""
