import { IconPlugConnected, IconPlugConnectedX, IconRefresh } from "@tabler/icons-react";
import { type Connection, useConnection } from "../live/store";
import { Time } from "../ui/Time";
import classes from "./Frame.module.css";

function describe({ state, worker }: Connection) {
  if (state === "away") return { text: "Server unreachable", Icon: IconPlugConnectedX, bad: true };
  if (state === "connecting") return { text: "Connecting", Icon: IconRefresh, bad: false };
  if (!worker) return { text: "Worker unreachable", Icon: IconPlugConnectedX, bad: true };
  return { text: "Live", Icon: IconPlugConnected, bad: false };
}

export function ConnectionState() {
  const { text, Icon, bad } = describe(useConnection());
  return (
    <span className={classes["connection"]} data-bad={bad || undefined} title={text}>
      <Icon size={18} aria-hidden />
      <span className={classes["connectionText"]}>{text}</span>
    </span>
  );
}

/** Banner that explains a lost connection until it is restored. */
export function ConnectionNotice() {
  const { state, worker, heardAt } = useConnection();
  if (state === "away") {
    return (
      <p className={classes["notice"]} role="status">
        <strong>The server is not responding.</strong> The data shown is
        {heardAt === null ? " out of date" : [" from ", <Time key="at" at={heardAt} />]}. The page updates automatically
        when the server is back.
      </p>
    );
  }
  if (state === "live" && !worker) {
    return (
      <p className={classes["notice"]} role="status">
        <strong>No worker is running.</strong> Flights and computations are paused until it is back. Start it with{" "}
        <code>gainline worker</code>.
      </p>
    );
  }
  return null;
}
