import { Button } from "@mantine/core";
import { IconRefresh } from "@tabler/icons-react";
import { Component, type ReactNode, useEffect, useRef, useState } from "react";
import { ApiError, BROKEN_PAGE } from "../api/problems";
import { useConnection } from "../live/store";
import { ErrorNotice } from "../ui/Notices";

async function reloadWhenAnswered(): Promise<boolean> {
  const answered = await fetch("/", { cache: "no-store" }).then(
    ({ ok }) => ok,
    () => false,
  );
  if (answered) window.location.reload();
  return answered;
}

/** Error page with a retry button; reloads automatically when a lost server is back. */
function PageUnavailable({ error }: { error: unknown }) {
  const [away, setAway] = useState(false);
  const { state } = useConnection();
  const before = useRef(state);
  useEffect(() => {
    if (before.current === "away" && state === "live") void reloadWhenAnswered();
    before.current = state;
  }, [state]);
  return (
    <>
      <ErrorNotice error={error instanceof ApiError ? error : new ApiError(BROKEN_PAGE)} />
      <Button
        my={14}
        leftSection={<IconRefresh size={20} aria-hidden />}
        onClick={async () => setAway(!(await reloadWhenAnswered()))}
      >
        Try again
      </Button>
      {away && <p role="status">The server is still not responding.</p>}
    </>
  );
}

interface GuardProps {
  /** A change of the path clears the error. */
  path: string;
  children: ReactNode;
}

interface GuardState {
  error: unknown;
}

/** Error boundary: shows a notice when a page's code cannot be loaded or rendering throws. */
export class PageGuard extends Component<GuardProps, GuardState> {
  override state: GuardState = { error: null };

  static getDerivedStateFromError(error: unknown): GuardState {
    return { error };
  }

  override componentDidUpdate({ path }: GuardProps): void {
    if (path !== this.props.path && this.state.error !== null) this.setState({ error: null });
  }

  override render(): ReactNode {
    return this.state.error === null ? this.props.children : <PageUnavailable error={this.state.error} />;
  }
}
