import type { Vehicle } from "../../api/types";
import { useVehicleStatus } from "../../live/store";
import { linkText, stepWord } from "../../live/vehicleStatus";
import { NOTHING, withUnit } from "../../ui/format";
import { LabelledValue } from "../../ui/LabelledValue";
import { Panel } from "../../ui/Panel";
import { percent } from "../../ui/uncertainty";
import classes from "./Fleet.module.css";

function armedText(armed: boolean | null | undefined): string {
  if (armed === null || armed === undefined) return NOTHING;
  return armed ? "armed" : "disarmed";
}

/** How the link is and what the vehicle says through it, as of now. */
export function LinkPanel({ vehicle }: { vehicle: Vehicle }) {
  const status = useVehicleStatus(vehicle.id);
  const isLinked = vehicle.state !== "disconnected";
  const stale = !(status?.isCurrent ?? false);
  const said = status?.status;
  const { identity } = vehicle;
  return (
    <Panel title="Connection">
      <div className={classes["stack"]}>
        {isLinked ? (
          <dl className={`${classes["facts"]} numbers`}>
            <LabelledValue title="Last heard" topic="linkAge" value={linkText(status)} bad={stale} />
            <LabelledValue title="Doing" value={said === undefined ? NOTHING : stepWord(said.step)} stale={stale} />
            <LabelledValue title="Motors" value={armedText(said?.armed)} stale={stale} />
            <LabelledValue title="Mode" value={said?.mode || NOTHING} stale={stale} />
            <LabelledValue title="Altitude" value={withUnit(said?.altitudeM, "m", 2)} stale={stale} />
            <LabelledValue title="Positions" value={withUnit(said?.positionHz, "per s", 0)} stale={stale} />
            <LabelledValue
              title="Packets lost"
              value={said?.lostShare === null || said === undefined ? NOTHING : percent(said.lostShare)}
              stale={stale}
            />
          </dl>
        ) : (
          <p className={classes["quiet"]}>
            Not connected.{" "}
            {identity === null
              ? "Connecting compares the gains that the vehicle holds with the safe ones, and changes nothing."
              : "Connecting writes the safe gains and reads them back; nothing moves."}
          </p>
        )}
        {said?.said && <p className={classes["quiet"]}>It says: {said.said}</p>}
        {said?.trouble && <p className={classes["bad"]}>{said.trouble}</p>}
        <p className={classes["quiet"]}>
          {String(vehicle.options["address"] ?? "")}, {String(vehicle.options["autopilot"] ?? "")}
          {identity !== null && `; pinned: system ${identity.system_id}, ${identity.autopilot} ${identity.version}`}
          {identity?.uid && `, hardware id ${identity.uid}`}
        </p>
      </div>
    </Panel>
  );
}
