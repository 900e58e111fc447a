import { Anchor } from "@mantine/core";
import { Link } from "react-router";
import { ErrorNotice } from "./ErrorNotice";

/** A page whose subject could not be had: why, and the way back. */
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
