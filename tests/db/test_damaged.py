"""Rows that can be read and make no sense any more: reported as a damaged database, not as an internal error."""

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import text

from app.db.session import Database
from tests.builders import create_campaign


@pytest.mark.parametrize(
    "spoil", ["definition = '{\"experiment\": '", "name = CAST(x'4265ff' AS TEXT)"], ids=["JSON", "text"]
)
def test_a_damaged_row_is_reported_as_a_damaged_database(client: TestClient, database: Database, spoil: str) -> None:
    campaign = create_campaign(client)
    with database.write() as session:
        session.execute(text(f"UPDATE campaign SET {spoil}"))
    for path in ("/api/campaigns", f"/api/campaigns/{campaign['id']}"):
        answer = client.get(path)
        assert answer.status_code == 503, answer.text
        assert "is damaged" in answer.json()["detail"]
        assert "restore the last backup" in answer.json()["hint"]
    assert client.get("/api/health").status_code == 200
