import { Anchor } from "@mantine/core";
import { Link } from "react-router";
import { useTitle } from "./useTitle";

export function NotFoundPage() {
  useTitle("Not found");
  return (
    <div style={{ padding: "12vh 0", textAlign: "center" }}>
      <h1>There is no such page</h1>
      <p>The address is mistyped, or what it showed has been deleted.</p>
      <Anchor component={Link} to="/">
        All campaigns
      </Anchor>
    </div>
  );
}
