/** Labels of vehicles, requests and gain history, and the form of a new vehicle. */

import type {
  ActKind,
  Catalogue,
  GivenGains,
  NewVehicle,
  OptionInfo,
  Vehicle,
  VehicleAct,
  VehicleState,
} from "../../api/types";
import type { Aged } from "../../live/vehicleStatus";
import { type NumberEntry, numbersOf, type OptionValue } from "../../ui/Fields";
import { bad, busy, good, quiet, type StateLabel } from "../../ui/states";

const STATES: Record<VehicleState, StateLabel> = {
  disconnected: quiet("Not connected"),
  ready: good("Ready"),
  staged: busy("Staged"),
  flying: busy("In flight"),
  quarantined: bad("Quarantined"),
};

/** States that are known only while data comes from the vehicle. */
const REPORTED: ReadonlySet<VehicleState> = new Set<VehicleState>(["ready", "staged", "flying"]);

const SILENCES = {
  connecting: busy("Connecting"),
  connected: bad("No data"),
  gone: bad("Link lost"),
  "not answering": bad("Commands blocked"),
} as const;

/** A shared vehicle has no permanent connection. `status` is null if the vehicle has none, or it is not known yet. */
export function vehicleStateLabel(vehicle: Vehicle, status: Aged | null): StateLabel {
  const { state, registered } = vehicle;
  if (!registered && state === "disconnected") return quiet("No link");
  if (status !== null && !status.isCurrent && REPORTED.has(state)) return SILENCES[status.status.state];
  if (state === "ready" && failedChecks(vehicle).length > 0) return bad("Preflight check failed");
  return STATES[state];
}

/** Titles of the items that failed at the last preflight check. */
function failedChecks({ checks }: Pick<Vehicle, "checks">): string[] {
  return (checks ?? []).filter(({ passed }) => !passed).map(({ title }) => title);
}

/** Why the vehicle cannot fly now, whatever the gains; empty if it can. */
export function groundedReason(vehicle: Vehicle): string {
  const { name, state, registered } = vehicle;
  if (state === "quarantined") return `${name} is quarantined.`;
  if (registered && state === "disconnected") return `${name} is not connected.`;
  const [first, ...others] = failedChecks(vehicle);
  if (first === undefined) return "";
  const failed = others.length === 0 ? first : `${first} and ${others.length} more`;
  return `${name} would refuse the takeoff: its last preflight check failed (${failed}). Correct this, then select Check now on its page.`;
}

/** Why the gains that the vehicle holds are not known. */
export function unknownGainsText({ held }: Pick<Vehicle, "held">, known: Aged | null): string {
  if (held === null || known === null) return "Gains not read.";
  const { armed, restarts, step } = known.status;
  if (restarts > 0) return "Gains not read since the vehicle restarted.";
  if (!known.isCurrent) return "Gains not read: no data is received from the vehicle.";
  const why = step === "observing" ? `: ${armed ? "while it is armed, " : ""}the vehicle is only monitored` : "";
  return `Gains not read since the connection was opened${why}.`;
}

export const ACTS: Record<ActKind, string> = {
  connect: "Connect",
  disconnect: "Disconnect",
  check: "Run preflight checks",
  restore: "Restore safe gains",
  parameters: "Read parameters",
  release: "Release from quarantine",
  land: "Land",
  "motors off": "Motors off",
  "safe gains": "Set safe gains",
  settings: "Change settings",
  control: "Take over control",
  stage: "Stage",
  "take-off": "Take off",
  unstage: "Unstage",
  abort: "Abort",
};

export const PURPOSES: Record<GivenGains["purpose"], string> = {
  flight: "Flight",
  "restore after flight": "Safe gains after flight",
  connect: "Safe gains at connection",
  restore: "Safe gains, on request",
  release: "Safe gains at release",
};

export function autopilotTitle(catalogue: Catalogue | undefined, { options }: Pick<Vehicle, "options">): string {
  return catalogue?.autopilots.find(({ name }) => name === options["autopilot"])?.label ?? "";
}

const KIND = "mavlink";
/** Options with their own fields in the form. */
const PLAIN: ReadonlySet<string> = new Set(["autopilot", "address", "simulated"]);

/** Fields of a vehicle to register, under the names of the request; text in a gain is not a number yet. */
export interface VehicleForm {
  name: string;
  options: Record<string, OptionValue>;
  safe_gains: Record<string, NumberEntry>;
  safe_gains_confirmed: boolean;
  statement: string;
}

export function autopilotOf({ options }: Pick<VehicleForm, "options">): string {
  return String(options["autopilot"] ?? "");
}

/** Gains of this autopilot's takeoff. */
export function gainsFor({ autopilots, experiments }: Catalogue, autopilot: string) {
  const takeoff = autopilots.find(({ name }) => name === autopilot)?.experiments[0];
  return experiments.find(({ name }) => name === takeoff)?.gains ?? [];
}

export function startingVehicle(catalogue: Catalogue): VehicleForm {
  const options = { simulated: false };
  const form = { name: "", options, safe_gains: {}, safe_gains_confirmed: false, statement: "" };
  return withAutopilot(form, catalogue, catalogue.autopilots[0]?.name ?? "");
}

/** Select an autopilot: resets the gains and updates an unedited address. */
export function withAutopilot(form: VehicleForm, catalogue: Catalogue, autopilot: string): VehicleForm {
  return {
    ...form,
    options: withUsualAddress(catalogue, { ...form.options, autopilot }),
    safe_gains: Object.fromEntries(gainsFor(catalogue, autopilot).map((gain) => [gain.name, gain.default])),
    safe_gains_confirmed: false,
  };
}

/** The options with the usual address of their vehicle, unless the address was edited. */
export function withUsualAddress({ autopilots }: Catalogue, options: VehicleForm["options"]): VehicleForm["options"] {
  const { address, autopilot, simulated } = options;
  const isUsual = autopilots.some((one) => address === one.address || address === one.simulated_address);
  if (address !== undefined && !isUsual) return options;
  const found = autopilots.find(({ name }) => name === autopilot);
  return { ...options, address: (simulated ? found?.simulated_address : found?.address) ?? "" };
}

/** The local port that an address needs for itself; the whole address if it names none. */
function portOf(vehicle: Pick<Vehicle, "options">): string {
  const address = String(vehicle.options["address"] ?? "");
  return /^udp:.*@(\d+)$/.exec(address)?.[1] ?? /^udpin:.*:(\d+)$/.exec(address)?.[1] ?? address;
}

/** Another vehicle of this server that is connected or looked for at the same address; null without one. */
export function vehicleAtSameAddress(vehicle: Vehicle, all: readonly Vehicle[]): Vehicle | null {
  const others = all.filter(
    ({ id, registered, actions }) => registered && id !== vehicle.id && actions.includes("disconnect"),
  );
  return others.find((other) => portOf(other) === portOf(vehicle)) ?? null;
}

/** Why the last request to connect has failed; empty if it has not, or the settings were changed since. */
export function connectFailure(acts: readonly VehicleAct[]): string {
  const newest = acts.find(({ kind }) => kind === "connect" || kind === "disconnect" || kind === "settings");
  return newest?.kind === "connect" ? newest.problem : "";
}

/** Options of the collapsed section; those of this autopilot alone, if one is given. */
export function furtherOptions(catalogue: Catalogue, autopilot?: string): OptionInfo[] {
  const options = catalogue.vehicle_kinds.find(({ name }) => name === KIND)?.options ?? [];
  const isOffered = ({ autopilots }: OptionInfo): boolean =>
    autopilot === undefined || autopilots.length === 0 || autopilots.includes(autopilot);
  return options.filter((option) => !PLAIN.has(option.name) && isOffered(option));
}

/** Names of safe gains without a valid number. */
export function unreadGains({ safe_gains }: Pick<VehicleForm, "safe_gains">): string[] {
  return Object.keys(safe_gains).filter((name) => typeof safe_gains[name] !== "number");
}

export function vehicleRequest({ name, statement, safe_gains, ...form }: VehicleForm): NewVehicle {
  return {
    ...form,
    kind: KIND,
    name: name.trim(),
    safe_gains: numbersOf(safe_gains),
    statement: statement.trim(),
  };
}

/** The parameters in an act's result, sorted by name. */
export function parametersOf(result: Readonly<Record<string, unknown>> | null): [string, number][] {
  const held = result?.["parameters"] ?? result;
  if (typeof held !== "object" || held === null) return [];
  return Object.entries(held)
    .filter((entry): entry is [string, number] => typeof entry[1] === "number")
    .sort(([one], [other]) => one.localeCompare(other));
}
