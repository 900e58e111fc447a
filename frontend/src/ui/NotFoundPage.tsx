import { Anchor } from "@mantine/core";
import { Link } from "react-router";
import { useTitle } from "./useTitle";

export function NotFoundPage() {
  useTitle("Not found");
  return (
    <div style={{ padding: "12vh 0", textAlign: "center" }}>
      <h1>Page not found</h1>
      <p>The URL is wrong, or the item was deleted.</p>
      <Anchor component={Link} to="/">
        All campaigns
      </Anchor>
    </div>
  );
}
