import { expect, test } from "vitest";
import { gainsInBrackets, sameHeld } from "./gains";

test("a gain set is written in brackets, in its own order", () => {
  expect(gainsInBrackets({ kp: 400, ki: 20, kd: 100 })).toBe("[400 20 100]");
});

test("gains are bracketed in the order asked for, however a vehicle reported them, an unknown one as a dash", () => {
  const names = ["MPC_Z_P", "MPC_Z_VEL_P_ACC", "MPC_Z_VEL_I_ACC", "MPC_Z_VEL_D_ACC"];
  const held = { MPC_Z_VEL_D_ACC: 0, MPC_Z_P: 1, MPC_Z_VEL_P_ACC: 4, MPC_Z_VEL_I_ACC: 2 };
  expect(gainsInBrackets(held, names)).toBe("[1 4 2 0]");
  expect(gainsInBrackets({ MPC_Z_VEL_I_ACC: 2, MPC_Z_P: 1 }, names)).toBe("[1 – 2 –]");
});

test("a vehicle holds its safe gains when it holds every one of them", () => {
  expect([
    sameHeld({ kp: 1, ki: 2 }, { kp: 1, ki: 2 }),
    sameHeld({ kp: 1 }, { kp: 1, ki: 2 }),
    sameHeld({}, {}),
  ]).toEqual([true, false, false]);
});
