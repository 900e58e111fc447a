"""What `.ci/api-fuzz` asks of every answer beside what schemathesis knows by itself."""

import schemathesis


@schemathesis.check
def explained_error(_context: object, response: schemathesis.Response, _case: object) -> None:
    """An error says its status, what happened and what to do."""
    if response.status_code >= 400:
        problem = response.json()
        assert problem["status"] == response.status_code, "status of the problem"
        assert problem["detail"], "no detail"
        assert problem["hint"], "no hint"
