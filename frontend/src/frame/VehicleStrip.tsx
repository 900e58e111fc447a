import { Text } from "@mantine/core";
import { IconAlertTriangle, IconAntennaBars5, IconAntennaBarsOff, IconBattery3, IconUser } from "@tabler/icons-react";
import type { ReactNode } from "react";
import { Link, useRoute } from "wouter";
import { useOwnLease } from "../api/leases";
import { useCampaign, useTrial } from "../api/queries";
import type { Vehicle } from "../api/types";
import { useVehicles } from "../api/vehicles";
import { useVehicleStatus } from "../live/store";
import { heldGains, linkText, lowBattery } from "../live/vehicleStatus";
import { VehicleBadge } from "../ui/Badges";
import { withUnit } from "../ui/format";
import { gainsInBrackets, inOrder, sameHeld } from "../ui/gains";
import classes from "./VehicleStrip.module.css";

const PACKET_AGE = "Time since the last packet from the vehicle";
const ALWAYS_SHOWN: readonly Vehicle["state"][] = ["staged", "flying", "quarantined"];

/** On every page: each connected vehicle with its link, battery, gains and operator. A fly screen needs its height: it
 * shows its own vehicle, and others only while something is up with them. */
export function VehicleStrip() {
  const own = useFlownVehicle();
  const connected = (useVehicles().data ?? []).filter(
    ({ registered, state }) => registered && state !== "disconnected",
  );
  return connected
    .filter(({ id, state }) => own === null || id === own || ALWAYS_SHOWN.includes(state))
    .map((vehicle) => <VehicleLine key={vehicle.id} vehicle={vehicle} isBrief={own !== null && vehicle.id !== own} />);
}

/** The vehicle of the fly screen that is open; null on other pages, and until it is known. */
function useFlownVehicle(): number | null {
  const trialId = Number(useRoute("/fly/:trialId")[1]?.trialId);
  const trial = useTrial(Number.isInteger(trialId) ? trialId : null).data;
  return useCampaign(trial?.campaign_id ?? null).data?.vehicle.id ?? null;
}

/** `isBrief`: on one line, with the link only. */
function VehicleLine({ vehicle, isBrief }: { vehicle: Vehicle; isBrief: boolean }) {
  const aged = useVehicleStatus(vehicle.id);
  const stale = aged === null || !aged.isCurrent;
  const low = lowBattery(vehicle, aged?.status.batteryV);
  return (
    <section className={classes["line"]} data-brief={isBrief || undefined} aria-label={`Vehicle ${vehicle.name}`}>
      <Link to={`/vehicles/${vehicle.id}`} className={classes["name"]}>
        <VehicleBadge isReal={vehicle.is_real} title={vehicle.name} />
      </Link>
      {vehicle.state === "quarantined" && (
        <span className={classes["quarantined"]} title={vehicle.concern}>
          <IconAlertTriangle size={16} aria-hidden />
          Quarantined{aged?.isCurrent && aged.status.armed && `, armed, ${withUnit(aged.status.altitudeM, "m", 1)}`}
        </span>
      )}
      {aged?.status.trouble && (
        <span className={classes["trouble"]} role="alert" title={aged.status.trouble}>
          {aged.status.trouble}
        </span>
      )}
      <Fact Icon={stale ? IconAntennaBarsOff : IconAntennaBars5} name="Link" title={PACKET_AGE} isBad={stale}>
        {linkText(aged)}
      </Fact>
      <Fact
        Icon={IconBattery3}
        name="Battery"
        title={`Battery ${vehicle.battery}`}
        isBad={low !== "" && !stale}
        isStale={stale}
      >
        {withUnit(aged?.status.batteryV, "V", 1)}
        {low !== "" && `, ${low}`}
      </Fact>
      <HeldGains vehicle={vehicle} held={heldGains(vehicle, aged)} stale={stale} />
      <InControl vehicle={vehicle} />
    </section>
  );
}

interface HeldProps {
  vehicle: Vehicle;
  held: Readonly<Record<string, number>>;
  stale: boolean;
}

interface FactProps {
  Icon?: typeof IconUser;
  /** What the icon says. */
  name?: string;
  title?: string;
  isBad?: boolean;
  isStale?: boolean;
  children: ReactNode;
}

function Fact({ Icon, name, title, isBad = false, isStale = false, children }: FactProps) {
  return (
    <span
      className={classes["fact"]}
      data-tone={isBad ? "bad" : undefined}
      data-stale={isStale || undefined}
      title={title}
    >
      {Icon && <Icon size={17} aria-hidden />}
      <span className="visually-hidden">{name}</span>
      {children}
    </span>
  );
}

/** Current gains next to the safe gains: from the link, which may not know them; without one as last read back. */
function HeldGains({ vehicle, held, stale }: HeldProps) {
  const { safe_gains: safe } = vehicle;
  const known = inOrder(held, Object.keys(safe));
  if (Object.keys(known).length === 0) return <Fact isStale>gains not read · safe {gainsInBrackets(safe)}</Fact>;
  const isSafe = sameHeld(known, safe);
  const Compared = stale ? "span" : "strong";
  return (
    <Fact title={`${Object.keys(safe).join(", ")}, read back`} isStale={stale}>
      <Text span inherit c="dimmed" visibleFrom="xs">
        gains
      </Text>
      {gainsInBrackets(known)}
      <Compared data-tone={isSafe ? "good" : "warn"}>{isSafe ? "safe" : `safe ${gainsInBrackets(safe)}`}</Compared>
    </Fact>
  );
}

function InControl({ vehicle }: { vehicle: Vehicle }) {
  const own = useOwnLease(vehicle.id);
  const { control } = vehicle;
  const isOwn = own !== null && (control === null || control.operator === own.operator);
  const who = isOwn ? `${own.operator} (you)` : (control?.operator ?? "no operator");
  return (
    <Fact Icon={IconUser} name="In control:" title="Operator in control" isStale={control === null && !isOwn}>
      <Text span inherit truncate maw="min(180px, 28vw)">
        {who}
      </Text>
    </Fact>
  );
}
