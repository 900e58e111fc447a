import { IconPlugConnected, IconPlugConnectedX, IconRefresh } from "@tabler/icons-react";
import { type Connection, useConnection } from "../live/store";
import { Time } from "../ui/Time";
import classes from "./Frame.module.css";

function said({ state, worker }: Connection) {
  if (state === "away") return { text: "Server away", Icon: IconPlugConnectedX, bad: true };
  if (state === "connecting") return { text: "Connecting", Icon: IconRefresh, bad: false };
  if (!worker) return { text: "Worker away", Icon: IconPlugConnectedX, bad: true };
  return { text: "Live", Icon: IconPlugConnected, bad: false };
}

export function ConnectionState() {
  const { text, Icon, bad } = said(useConnection());
  return (
    <span className={classes["connection"]} data-bad={bad || undefined} title={text}>
      <Icon size={18} aria-hidden />
      <span className={classes["connectionText"]}>{text}</span>
    </span>
  );
}

/** What a lost connection means, across the page, until it is back. */
export function ConnectionNotice() {
  const { state, worker, heardAt } = useConnection();
  if (state === "away") {
    return (
      <p className={classes["notice"]} role="status">
        <strong>The server does not answer.</strong> What you see was so
        {heardAt === null ? " earlier" : [" at ", <Time key="at" at={heardAt} />]}. This page catches up by itself as
        soon as the server is back.
      </p>
    );
  }
  if (state === "live" && !worker) {
    return (
      <p className={classes["notice"]} role="status">
        <strong>No worker is running.</strong> Nothing can fly and no proposal is computed until it is back; start it
        with <code>gainline worker</code>.
      </p>
    );
  }
  return null;
}
