"""Windows that other programs move: messages, the server in the window, and the client."""
