"""Monitors of a trial: each is one small frozen state of what was heard, with its own update and its own findings.

`observation` composes them. A monitor knows no other: what it needs of another one is an argument. Updates and findings
are apart, because what counts as a failure depends on the state of the trial and on the time that passes without a
message; where one message decides both (`commanded`), the update returns its finding. Times are in s by the ground's
clock, except inside a Position; altitudes in m on the vehicle's datum.
"""
