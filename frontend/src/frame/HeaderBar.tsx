import { ActionIcon, Box, Group, Text, useComputedColorScheme, useMantineColorScheme } from "@mantine/core";
import { IconMoon, IconPlugConnected, IconPlugConnectedX, IconRefresh, IconSun } from "@tabler/icons-react";
import { Link } from "wouter";
import { type AbortControl, abortStage, type FlyingCampaign } from "../live/flights";
import {
  type Connection,
  liveNow,
  useConnection,
  useIsOutputCurrent,
  useLiveFlight,
  useVehicleStatus,
} from "../live/store";
import { outputNow, readingOf } from "../live/telemetry";
import { isAfterRecord, isDown, oneOf } from "../live/vehicleStatus";
import { AbortButton } from "../ui/AbortButton";
import { VehicleBadge } from "../ui/Badges";
import { withUnit } from "../ui/format";
import { Time } from "../ui/Time";
import classes from "./Frame.module.css";

function describe({ state, worker }: Connection) {
  if (state === "away") return { text: "Server not responding", Icon: IconPlugConnectedX, bad: true };
  if (state === "connecting") return { text: "Connecting", Icon: IconRefresh, bad: false };
  if (!worker) return { text: "Worker not responding", Icon: IconPlugConnectedX, bad: true };
  return { text: "Live", Icon: IconPlugConnected, bad: false };
}

export function ConnectionState() {
  const { text, Icon, bad } = describe(useConnection());
  return (
    <span className={classes["connection"]} data-bad={bad || undefined} title={text}>
      <Icon size={18} aria-hidden />
      <Box component="span" visibleFrom={bad ? "xs" : undefined}>
        {text}
      </Box>
    </span>
  );
}

/** Banner that explains a lost connection until it is restored. */
export function ConnectionNotice({ flying }: { flying: readonly FlyingCampaign[] }) {
  const { state, worker, heardAt } = useConnection();
  if (state === "away") {
    return (
      <p className={classes["notice"]} data-tone="warn" role="status">
        <strong>The server is not responding.</strong>{" "}
        {heardAt === null ? "The data is out of date. " : ["Data as of ", <Time key="at" at={heardAt} seconds />, ". "]}
        The page updates automatically when the server is back.
      </p>
    );
  }
  if (state === "live" && !worker) {
    return (
      <p className={classes["notice"]} data-tone="warn" role="status">
        <strong>The worker is not responding.</strong> {withoutWorker(flying)} The server restarts its own worker within
        seconds. If the worker runs separately, start it again with <code>gainline worker</code>.
      </p>
    );
  }
  return null;
}

/** Phases of a flight that has not left the ground. */
const isOnGround = oneOf("staging", "staged");

/** What the loss of the worker means, as the fly screen says it; a vehicle in the air is not paused. */
function withoutWorker(flying: readonly FlyingCampaign[]): string {
  const inTheAir = flying.filter(({ trialId }) => !isOnGround(liveNow(trialId)?.phase));
  if (inTheAir.some(({ hasLink }) => hasLink)) {
    return "If the worker has stopped, the vehicle is landing now; if only the connection to the worker is lost, the flight continues. If in doubt, use the vehicle's own remote control.";
  }
  if (inTheAir.length > 0) return "If the worker has stopped, the simulated flight is lost.";
  return "Nothing can be flown or computed until it is back.";
}

/** Live readings of one flight and its abort button, which acts without confirmation. */
export function FlyingBar({ flying, abort }: { flying: FlyingCampaign; abort: AbortControl }) {
  const live = useLiveFlight(flying.trialId);
  const status = useVehicleStatus(flying.vehicleId);
  const isCurrent = useIsOutputCurrent(live, status);
  const isAfter = isAfterRecord(status?.status.step);
  const stage = abortStage(flying.trialId, abort, status?.status.step);
  const time = live?.timeS.at(-1);
  const reading = readingOf(live?.channel ?? "");
  return (
    <Group
      component="section"
      justify="flex-end"
      gap="clamp(8px, 2vw, 14px)"
      wrap="nowrap"
      aria-label={`Flight in progress: ${flying.name}`}
    >
      <Box className={classes["vehicle"]} maw={220} visibleFrom="xs">
        <VehicleBadge isReal={flying.isReal} title={flying.vehicleName} />
      </Box>
      <Text span truncate c="dimmed" fz="small" maw={320} visibleFrom="md" title={flying.name}>
        {flying.name} · flight {flying.trialNumber}
      </Text>
      {isCurrent && (
        <Box component="span" className={classes["pulse"]} visibleFrom="xs" data-reduce-motion aria-hidden />
      )}
      <Link
        to={`/fly/${flying.trialId}`}
        className={classes["readings"]}
        data-stale={!isCurrent || undefined}
        title="Open fly screen"
      >
        {time === undefined ? (
          <span>{isOnGround(live?.phase) ? live?.phase : "in flight"}</span>
        ) : (
          <>
            <span className={classes["output"]}>{withUnit(outputNow(live, status), reading.unit, reading.digits)}</span>
            {!isAfter && <span>{withUnit(time, "s", 1)}</span>}
            {!isCurrent && <span>last known</span>}
          </>
        )}
      </Link>
      {!isDown(status, time !== undefined) && <AbortButton trialId={flying.trialId} stage={stage} abort={abort} />}
    </Group>
  );
}

export function ThemeSwitch() {
  const { setColorScheme } = useMantineColorScheme();
  const dark = useComputedColorScheme("light") === "dark";
  const next = dark ? "light" : "dark";
  return (
    <ActionIcon
      color="gray"
      variant="subtle"
      aria-label={`Switch to the ${next} theme`}
      title={`Switch to the ${next} theme`}
      onClick={() => setColorScheme(next)}
    >
      {dark ? <IconSun size={22} color="var(--ink)" /> : <IconMoon size={22} color="var(--ink)" />}
    </ActionIcon>
  );
}
