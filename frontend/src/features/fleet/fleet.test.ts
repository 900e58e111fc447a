import { expect, test } from "vitest";
import type { Catalogue, Vehicle, VehicleAct } from "../../api/types";
import type { Aged } from "../../live/vehicleStatus";
import {
  connectFailure,
  furtherOptions,
  groundedReason,
  parametersOf,
  startingVehicle,
  unknownGainsText,
  unreadGains,
  vehicleAtSameAddress,
  vehicleRequest,
  vehicleStateLabel,
  withAutopilot,
  withUsualAddress,
} from "./fleet";

const catalogue = {
  experiments: [
    {
      name: "takeoff",
      gains: [
        { name: "kp", default: 283 },
        { name: "ki", default: 13 },
        { name: "kd", default: 82 },
      ],
    },
    { name: "takeoff-px4", gains: [{ name: "MPC_Z_P", default: 1 }] },
  ],
  autopilots: [
    {
      name: "paparazzi",
      experiments: ["takeoff", "altitude-steps"],
      address: "udp:192.168.1.1:4245@4244",
      simulated_address: "udp:127.0.0.1:4245@4244",
    },
    {
      name: "px4",
      experiments: ["takeoff-px4"],
      address: "udpin:127.0.0.1:14550",
      simulated_address: "udpin:127.0.0.1:14550",
    },
  ],
  vehicle_kinds: [
    {
      name: "mavlink",
      options: [
        { name: "autopilot" },
        { name: "address" },
        { name: "simulated" },
        { name: "min_battery_v", autopilots: [] },
        { name: "aircraft_id", autopilots: ["paparazzi"] },
        { name: "signing_key_file", autopilots: ["ardupilot", "px4"] },
      ],
    },
  ],
} as unknown as Catalogue;

const start = startingVehicle(catalogue);

test("another autopilot brings its own gains and usual address, and nobody has looked at them yet", () => {
  const form = withAutopilot({ ...start, safe_gains_confirmed: true }, catalogue, "px4");
  expect(form.options).toEqual({ autopilot: "px4", address: "udpin:127.0.0.1:14550", simulated: false });
  expect(form.safe_gains).toEqual({ MPC_Z_P: 1 });
  expect(form.safe_gains_confirmed).toBe(false);
});

test("a simulated vehicle has its autopilot's usual address too, whichever was chosen first", () => {
  const simulated = withUsualAddress(catalogue, { ...start.options, simulated: true });
  expect(simulated["address"]).toBe("udp:127.0.0.1:4245@4244");
  const px4 = withAutopilot({ ...start, options: simulated }, catalogue, "px4");
  expect(px4.options["address"]).toBe("udpin:127.0.0.1:14550");
});

test("an address that somebody has typed stays with another autopilot", () => {
  const typed = { ...start, options: { ...start.options, address: "serial:/dev/ttyUSB0:57600" } };
  expect(withAutopilot(typed, catalogue, "px4").options["address"]).toBe("serial:/dev/ttyUSB0:57600");
});

test("the request has the numbers as they are, and names without the spaces around them", () => {
  const options = { ...start.options, min_battery_v: 11 };
  const form = { ...start, name: " Bee ", options, safe_gains_confirmed: true, statement: " Ada has looked " };
  expect(vehicleRequest(form)).toEqual({
    name: "Bee",
    kind: "mavlink",
    options: { autopilot: "paparazzi", address: "udp:192.168.1.1:4245@4244", simulated: false, min_battery_v: 11 },
    safe_gains: { kp: 283, ki: 13, kd: 82 },
    safe_gains_confirmed: true,
    statement: "Ada has looked",
  });
});

test("a gain that is no number yet is named, and not sent", () => {
  const form = { ...start, safe_gains: { ...start.safe_gains, ki: "1e" } };
  expect(unreadGains(form)).toEqual(["ki"]);
  expect(vehicleRequest(form).safe_gains).toEqual({ kp: 283, kd: 82 });
});

test("only what has no place of its own is folded away, and an autopilot is asked for no option of another one", () => {
  const names = (autopilot?: string): string[] => furtherOptions(catalogue, autopilot).map(({ name }) => name);
  expect(names()).toEqual(["min_battery_v", "aircraft_id", "signing_key_file"]);
  expect(names("paparazzi")).toEqual(["min_battery_v", "aircraft_id"]);
  expect(names("px4")).toEqual(["min_battery_v", "signing_key_file"]);
});

test("parameters are read out of an act's result by their names in order, and there are none before it has one", () => {
  expect(parametersOf({ parameters: { WPNAV_SPEED: 5, ANGLE_MAX: 30, note: "text" } })).toEqual([
    ["ANGLE_MAX", 30],
    ["WPNAV_SPEED", 5],
  ]);
  expect(parametersOf(null)).toEqual([]);
});

test("another vehicle at the same local port is found while it is connected or looked for", () => {
  const at = (id: number, address: string, actions: string[] = []): Vehicle =>
    ({ id, registered: true, options: { address }, actions }) as unknown as Vehicle;
  const here = at(1, "udpin:127.0.0.1:14550", ["disconnect"]);
  const other = at(2, "udpin:0.0.0.0:14550", ["disconnect"]);
  expect(vehicleAtSameAddress(here, [here, other])).toBe(other);
  expect(vehicleAtSameAddress(here, [here, at(2, "udpin:0.0.0.0:14550", ["connect"])])).toBeNull();
  expect(vehicleAtSameAddress(here, [here, at(2, "udp:127.0.0.1:14550@4244", ["disconnect"])])).toBeNull();
});

test("a failed connection states its reason until a newer request", () => {
  const act = (kind: string, problem = ""): VehicleAct => ({ kind, problem }) as unknown as VehicleAct;
  const failed = act("connect", "The port could not be opened.");
  expect(connectFailure([act("check"), failed])).toBe("The port could not be opened.");
  expect(connectFailure([act("disconnect"), failed])).toBe("");
  expect(connectFailure([act("connect"), failed])).toBe("");
});

test("a registered vehicle without a link is not connected; what is flown elsewhere has no link", () => {
  const words = (seen: Partial<Vehicle>): string => vehicleStateLabel(seen as Vehicle, null).word;
  expect(words({ state: "disconnected", registered: true })).toBe("Not connected");
  expect(words({ state: "disconnected", registered: false })).toBe("No link");
  expect(words({ state: "ready", registered: false })).toBe("Ready");
  expect(words({ state: "quarantined", registered: true })).toBe("Quarantined");
});

test("a vehicle from which nothing comes is never said to be in flight, staged or ready", () => {
  const word = (state: Vehicle["state"], link: string, isCurrent = false): string =>
    vehicleStateLabel({ state, registered: true } as Vehicle, { status: { state: link }, isCurrent } as Aged).word;
  expect((["ready", "staged", "flying"] as const).map((state) => word(state, "gone"))).toEqual(
    Array(3).fill("Link lost"),
  );
  expect(["connecting", "connected", "not answering"].map((link) => word("flying", link))).toEqual([
    "Connecting",
    "No data",
    "Commands blocked",
  ]);
  expect(word("quarantined", "gone")).toBe("Quarantined");
  expect(word("flying", "connected", true)).toBe("In flight");
});

const failing = [
  { title: "Fence", passed: true },
  { title: "FS_GCS_ENABLE", passed: false },
];

test("a vehicle whose last preflight check has failed is not said to be ready", () => {
  const word = (seen: object): string =>
    vehicleStateLabel({ state: "ready", registered: true, checks: failing, ...seen } as Vehicle, null).word;
  expect([
    word({}),
    word({ state: "quarantined" }),
    word({ checks: failing.slice(0, 1) }),
    word({ checks: null }),
  ]).toEqual(["Preflight check failed", "Quarantined", "Ready", "Ready"]);
});

test("a campaign says why the takeoff of its vehicle would be refused", () => {
  const reason = (seen: object): string =>
    groundedReason({ name: "Drone", state: "ready", registered: true, checks: null, ...seen } as Vehicle);
  expect(reason({})).toBe("");
  expect(reason({ checks: failing })).toContain("its last preflight check failed (FS_GCS_ENABLE)");
  expect(reason({ checks: [...failing, ...failing] })).toContain("failed (FS_GCS_ENABLE and 1 more)");
  expect(reason({ checks: failing, state: "disconnected" })).toBe("Drone is not connected.");
  expect(reason({ state: "disconnected", registered: false })).toBe("");
});

test("a vehicle that has not restarted is not said to have restarted", () => {
  const why = (status: object, isCurrent = true): string =>
    unknownGainsText({ held: {} }, { status: { restarts: 0, ...status }, isCurrent } as Aged);
  expect(why({ restarts: 1 })).toBe("Gains not read since the vehicle restarted.");
  expect(why({ step: "observing", armed: true })).toBe(
    "Gains not read since the connection was opened: while it is armed, the vehicle is only monitored.",
  );
  expect(why({ step: "observing", armed: false })).not.toContain("armed");
  expect(why({}, false)).toBe("Gains not read: no data is received from the vehicle.");
  expect(unknownGainsText({ held: null }, null)).toBe("Gains not read.");
});
