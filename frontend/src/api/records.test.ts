import { describe, expect, it } from "vitest";
import { type Problem, problemFrom } from "./problems";
import { confirmationIn, readingsIn, recordOf, takeoffsIn } from "./records";

const named = (name: string): File => new File(["content"], name);
const refusal = (problems: { field: string; reason: string; code?: string }[]): Problem =>
  problemFrom(422, { title: "No", problems });

describe("the chosen files", () => {
  it("are a record and its companion, in any order", () => {
    const [data, log] = [named("flight.data"), named("flight.LOG")];
    expect(recordOf([log, data])).toEqual({ file: data, companion: log });
  });

  it("may be a record alone", () => {
    const tlog = named("flight.tlog");
    expect(recordOf([tlog])).toEqual({ file: tlog });
    expect(recordOf([])).toBeNull();
  });

  it("are sent as they are when only a companion was chosen: the server says what is wrong", () => {
    const log = named("flight.log");
    expect(recordOf([log])).toEqual({ file: log });
  });
});

describe("what the server asks", () => {
  it("is which takeoff, where a log holds several", () => {
    const problem = refusal([
      { field: "takeoff", reason: "1: 18.4 s into the log, kp 283" },
      { field: "takeoff", reason: "2: 95.9 s into the log, kp 1624" },
    ]);
    expect(takeoffsIn(problem)).toEqual([
      { number: 1, summary: "18.4 s into the log, kp 283" },
      { number: 2, summary: "95.9 s into the log, kp 1624" },
    ]);
    expect(confirmationIn(problem)).toBeNull();
  });

  it("is whether gains that were not planned shall be taken", () => {
    expect(confirmationIn(refusal([{ field: "confirm", reason: "not the trial's" }]))).toBe("confirm");
  });

  it("is whether a record that cannot be scored shall be stored", () => {
    expect(confirmationIn(refusal([{ field: "invalid", reason: "ends too early" }]))).toBe("invalid");
  });

  it("is what the record shall be read with, where that makes it a flight", () => {
    const problem = refusal([
      { field: "reads_as", reason: "looks like altitude in feet", code: "feet" },
      { field: "reads_as", reason: "looks like altitude above another level", code: "other-datum" },
      { field: "reads_as", reason: "looks like something newer than this page", code: "furlongs" },
      { field: "invalid", reason: "it begins at 1417.00 m", code: "off ground" },
    ]);
    expect(readingsIn(problem)).toEqual(["feet", "other-datum"]);
    expect(confirmationIn(problem)).toBe("invalid");
    expect(readingsIn(refusal([{ field: "invalid", reason: "ends too early", code: "unscorable" }]))).toEqual([]);
  });

  it("is nothing when something else was refused", () => {
    const problem = refusal([{ field: "file", reason: "1: is empty" }]);
    expect(takeoffsIn(problem)).toEqual([]);
    expect(confirmationIn(problem)).toBeNull();
    expect(takeoffsIn(null)).toEqual([]);
  });
});
