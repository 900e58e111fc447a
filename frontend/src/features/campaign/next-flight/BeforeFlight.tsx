/** What cards say of a flight: its scored window, its prediction, and why it cannot fly now or did not fly last time. */

import { Anchor } from "@mantine/core";
import { Link } from "wouter";
import { useCatalogue } from "../../../api/queries";
import type { Definition, Trial } from "../../../api/types";
import { useVehicle } from "../../../api/vehicles";
import { asSentence, withUnit } from "../../../ui/format";
import { Note } from "../../../ui/Note";
import { FailureNotice } from "../../../ui/Notices";
import { intervalText } from "../../../ui/uncertainty";
import { groundedReason } from "../../fleet/fleet";
import { windowOf } from "../campaignSettings";
import { isWithdrawnByOperator } from "./nextStep";

/** One line before a flight: how long it is scored, and so how long it flies. */
export function FlightWindow({ definition }: { definition: Definition }) {
  const seconds = windowOf(definition, useCatalogue().data);
  return seconds === null ? null : <Note fz="small">Scored window: {seconds} s from the takeoff command</Note>;
}

/** The predicted error with its interval. */
export function Predicted({ trial, unit }: { trial: Trial | undefined; unit: string }) {
  return (
    <>
      {withUnit(trial?.predicted_error, unit)}{" "}
      {trial?.predicted_interval && <small>{intervalText(trial.predicted_interval, unit)}</small>}
    </>
  );
}

/** Why the vehicle cannot fly now, whatever the gains; empty if it can. */
export function useGroundedReason(vehicleId: number): string {
  const vehicle = useVehicle(vehicleId);
  return vehicle === null ? "" : groundedReason(vehicle);
}

/** The reason, with a link to the vehicle; renders nothing without one. */
export function GroundedNote({ vehicleId }: { vehicleId: number }) {
  const why = useGroundedReason(vehicleId);
  if (why === "") return null;
  return (
    <Note fz="body">
      {why}{" "}
      <Anchor component={Link} to={`/vehicles/${vehicleId}`}>
        Open vehicle
      </Anchor>
    </Note>
  );
}

/** Why a planned trial's last flight was not flown: a note if the operator chose so. Renders nothing without a reason. */
export function FlightProblem({ flight }: Pick<Trial, "flight">) {
  if (isWithdrawnByOperator({ flight })) return <Note fz="body">{asSentence(flight?.problem ?? "")}</Note>;
  return <FailureNotice reason={flight?.problem ?? ""} />;
}
