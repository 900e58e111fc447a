import { Button } from "@mantine/core";
import { IconRefresh } from "@tabler/icons-react";
import { useEffect, useRef, useState } from "react";
import { ApiError, BROKEN_PAGE } from "../lib/problems";
import { useConnection } from "../live/store";
import { Trouble } from "./Trouble";

async function reloadWhenAnswered(): Promise<boolean> {
  const answered = await fetch("/", { cache: "no-store" }).then(
    ({ ok }) => ok,
    () => false,
  );
  if (answered) window.location.reload();
  return answered;
}

/** A page that cannot be shown: why, and another try; by itself once a lost server is back. */
export function PageUnavailable({ error }: { error: unknown }) {
  const [away, setAway] = useState(false);
  const { state } = useConnection();
  const before = useRef(state);
  useEffect(() => {
    if (before.current === "away" && state === "live") void reloadWhenAnswered();
    before.current = state;
  }, [state]);
  return (
    <>
      <Trouble error={error instanceof ApiError ? error : new ApiError(BROKEN_PAGE)} />
      <Button
        my={14}
        leftSection={<IconRefresh size={20} aria-hidden />}
        onClick={async () => setAway(!(await reloadWhenAnswered()))}
      >
        Try again
      </Button>
      {away && <p role="status">The server does not answer yet.</p>}
    </>
  );
}
