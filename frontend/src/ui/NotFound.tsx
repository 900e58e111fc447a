import { Anchor } from "@mantine/core";
import { Link } from "react-router";
import { ErrorNotice } from "./ErrorNotice";

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
