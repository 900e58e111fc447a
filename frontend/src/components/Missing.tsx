import { Anchor } from "@mantine/core";
import { Link } from "react-router";
import { Trouble } from "./Trouble";

/** A page whose subject could not be had: why, and the way back. */
export function Missing({ error }: { error: unknown }) {
  return (
    <>
      <Trouble error={error} />
      <Anchor component={Link} to="/" display="inline-block" py={14}>
        All campaigns
      </Anchor>
    </>
  );
}
