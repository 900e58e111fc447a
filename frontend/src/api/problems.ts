/** What the server says when it refuses: RFC 9457 problem details, with our hint and the refused fields. */

export interface FieldProblem {
  field: string;
  reason: string;
  /** Values of gains that would pass, where the server knows them. */
  offer?: Record<string, number>;
}

export interface Problem {
  status: number;
  title: string;
  detail: string;
  hint: string;
  problems: FieldProblem[];
}

export class ApiError extends Error {
  readonly problem: Problem;

  constructor(problem: Problem) {
    super(problem.detail || problem.title);
    this.name = "ApiError";
    this.problem = problem;
  }
}

const UNREACHABLE: Problem = {
  status: 0,
  title: "The server cannot be reached.",
  detail: "It is not known whether what was asked has arrived there.",
  hint: "Check that Gainline runs and that the Wi-Fi is up. This page catches up by itself: look at it before asking again.",
  problems: [],
};

/** The program was updated, or the server went away, after this tab was opened. */
export const PAGE_MISSING: Problem = {
  status: 0,
  title: "This page could not be fetched.",
  detail: "The server is away, or it was updated since this tab was opened. What flies goes on; nothing was changed.",
  hint: "Try again; once a lost server is back, the page comes by itself.",
  problems: [],
};

export const BROKEN_PAGE: Problem = {
  status: 0,
  title: "This page broke while it was drawn.",
  detail: "It is a fault of this program. What flies goes on; nothing was changed.",
  hint: "Try again; the other pages still work. The browser's console says more.",
  problems: [],
};

function text(value: unknown): string {
  return typeof value === "string" ? value : "";
}

function fieldProblems(value: unknown): FieldProblem[] {
  if (!Array.isArray(value)) return [];
  return value.flatMap((entry: unknown) => {
    if (typeof entry !== "object" || entry === null) return [];
    const { field, reason, offer } = entry as Record<string, unknown>;
    if (typeof field !== "string" || typeof reason !== "string") return [];
    const offered = offeredBy(offer);
    return [{ field, reason, ...(Object.keys(offered).length > 0 ? { offer: offered } : {}) }];
  });
}

function offeredBy(value: unknown): Record<string, number> {
  if (typeof value !== "object" || value === null) return {};
  return Object.fromEntries(Object.entries(value).filter(([, number]) => typeof number === "number"));
}

/** Whether it was gains that were refused, and not something else about the request. */
export function isGateRefusal(problem: Problem | null): boolean {
  const fields = (problem?.problems ?? []).map(({ field }) => field.replace(/^body\./, ""));
  return fields.length > 0 && fields.every((field) => field === "gains" || field.startsWith("gains."));
}

/** Every gain's value that would pass, of all refusals together. */
export function offersOf(problem: Problem | null): [gain: string, value: number][] {
  const all = Object.assign({}, ...(problem?.problems ?? []).map(({ offer }) => offer ?? {})) as Record<string, number>;
  return Object.entries(all);
}

/** What the limits say that offer other values; every offer lies within all of them. */
export function limitsOf(problem: Problem | null): string[] {
  return [...new Set((problem?.problems ?? []).filter(({ offer }) => offer !== undefined).map(({ reason }) => reason))];
}

/** Whatever a failed request brought, as a problem that can be shown. */
export function problemFrom(status: number | undefined, body: unknown): Problem {
  if (status === undefined) return UNREACHABLE;
  const found = (typeof body === "object" && body !== null ? body : {}) as Record<string, unknown>;
  return {
    status,
    title: text(found["title"]) || `The server answered ${status}.`,
    detail: text(found["detail"]),
    hint: text(found["hint"]) || (status >= 500 ? "Try again; if it happens again, look into the server's log." : ""),
    problems: fieldProblems(found["problems"]),
  };
}

export function problemOf(error: unknown): Problem | null {
  if (error === null || error === undefined) return null;
  if (error instanceof ApiError) return error.problem;
  return { ...UNREACHABLE, title: error instanceof Error ? error.message : UNREACHABLE.title };
}

/** Reason per field. A refused field can stand anywhere below `prefix` (`body.definition.bounds.kp`). */
export function reasonsByField(problem: Problem | null, fields: readonly string[]): Record<string, string> {
  const reasons: Record<string, string> = {};
  for (const { field, reason } of problem?.problems ?? []) {
    const owner = fields
      .filter((name) => field === name || field.endsWith(`.${name}`) || `.${field}.`.includes(`.${name}.`))
      .sort((one, other) => other.length - one.length)[0];
    if (owner !== undefined) reasons[owner] = reasons[owner] ? joined(reasons[owner], reason) : reason;
  }
  return reasons;
}

/** Sentences stand side by side; words that are none are kept apart by a semicolon. */
function joined(one: string, other: string): string {
  return /[.!?]$/.test(one) ? `${one} ${other}` : `${one}; ${other}`;
}

/** What decides first: harm in flight, the worst first, before mere limits. */
const WEIGHT = [/stuck on the ground/, /wrap/, /ceiling|diverge|rise/];

/** The reason that a person has to read of a refusal of gains, and the other ones. */
export function reasonsByWeight(problem: Problem | null): string[] {
  const rank = (reason: string): number => {
    const found = WEIGHT.findIndex((words) => words.test(reason));
    return found === -1 ? WEIGHT.length : found;
  };
  const reasons = new Set((problem?.problems ?? []).map(({ reason }) => reason));
  return [...reasons].sort((one, other) => rank(one) - rank(other));
}

/** The refused fields that none of `fields` shows. */
export function otherProblems(problem: Problem | null, fields: readonly string[]): FieldProblem[] {
  return (problem?.problems ?? []).filter(
    (one) => Object.keys(reasonsByField({ ...UNREACHABLE, problems: [one] }, fields)).length === 0,
  );
}

/** Whether a failed reading is worth another try: a server that is away may come back, a refusal stays one. */
export function retries(failures: number, error: unknown): boolean {
  const problem = problemOf(error);
  return failures < 3 && (problem === null || problem.status === 0 || problem.status >= 500);
}
