"""A small HTTP/1.1 server, which knows of its application what ``interface`` says.

Why it exists:

- Speed. The thread that waits for a client's request also answers it, while servers that run on
  Windows, macOS and Linux alike hand each request over to another thread. Microseconds a request
  (and requests a second) on one kept-alive connection, medians of 11 interleaved runs of 1,000
  on two busy cores:

      ==================  ===================  =====================
      application         this server          waitress 3.0.2
      ==================  ===================  =====================
      a bare one          24 (42,000)          146 (6,800)
      Flask, one route    139 (7,200)          246 (4,100)
      ==================  ===================  =====================

- A thread that is stuck in the application can be answered for, ``Server.answer_for()``: its client
  gets an answer, and its connection closes.
- The stop loses no answer: requests that have arrived are answered before ``Server.run()`` returns.
- Clients that do not read, that send drop by drop, or that open thousands of connections keep
  nobody out.

What it does not do: TLS, HTTP/2, WebSockets, compression, files, answers in chunks (an answer is
sent when all of it is there), several processes. A reverse proxy before it does what of that is
needed. It takes a thread for each connection.
"""
