"""Who may do what: permissions of a request, and the secret that unlocks a browser."""
