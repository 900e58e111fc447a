import { describe, expect, it } from "vitest";
import { readOnlyReason, registrationRefusal } from "./access";
import type { Access } from "./types";

const HINT = "Open the link that the terminal printed.";
const UNLOCKED: Access = { elsewhere: false, may_change: true, may_link: true, may_command: true, hint: "" };
const LOCKED: Access = { ...UNLOCKED, may_command: false, hint: HINT };
const EXPOSED: Access = { ...UNLOCKED, may_link: false, may_command: false };
const REMOTE: Access = { elsewhere: true, may_change: true, may_link: false, may_command: false, hint: "" };
const STRANGER: Access = { ...REMOTE, may_change: false, hint: HINT };

const real = { name: "Bee", is_real: true, registered: true };
const simulated = { ...real, is_real: false };
const shared = { ...simulated, registered: false };

describe("a browser with read-only access", () => {
  it("is nobody in an unlocked browser on this computer", () => {
    for (const vehicle of [null, real, simulated, shared]) expect(readOnlyReason(UNLOCKED, vehicle)).toBeNull();
  });

  it("is told for a real vehicle alone, with the way out, before the browser is unlocked", () => {
    expect(readOnlyReason(LOCKED, real)).toBe(
      `This browser has read-only access to Bee. ${HINT} Abort and Land still work from here.`,
    );
    for (const vehicle of [null, simulated, shared]) expect(readOnlyReason(LOCKED, vehicle)).toBeNull();
  });

  it("is told for every vehicle with a link on a server that others reach", () => {
    for (const vehicle of [real, simulated]) expect(readOnlyReason(EXPOSED, vehicle)).toContain("--host 127.0.0.1");
    for (const vehicle of [null, shared]) expect(readOnlyReason(EXPOSED, vehicle)).toBeNull();
  });

  it("is told on another device where the vehicle is commanded", () => {
    expect(readOnlyReason(REMOTE, real)).toContain("from the computer that runs Gainline");
    expect(readOnlyReason(REMOTE, null)).toBeNull();
  });

  it("is told before a vehicle is registered that this browser may not command", () => {
    expect(registrationRefusal(LOCKED, true)).toBe(`This browser may not register a real vehicle. ${HINT}`);
    expect(registrationRefusal(LOCKED, false)).toBeNull();
    expect(registrationRefusal(EXPOSED, false)).toContain("--host 127.0.0.1");
    expect(registrationRefusal(UNLOCKED, true)).toBeNull();
  });

  it("is told of everything on a device that has not opened a link", () => {
    expect(readOnlyReason(STRANGER, null)).toBe(`This browser has read-only access. ${HINT}`);
  });
});
