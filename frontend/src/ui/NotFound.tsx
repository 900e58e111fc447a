import { Anchor } from "@mantine/core";
import { Link } from "wouter";
import { ErrorNotice } from "./Notices";
import { useTitle } from "./useTitle";

/** Error page of an item that could not be loaded, with a link to all campaigns. */
export function NotFound({ error }: { error: unknown }) {
  return (
    <>
      <ErrorNotice error={error} />
      <Anchor component={Link} to="/" display="inline-block" py={14}>
        All campaigns
      </Anchor>
    </>
  );
}

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
