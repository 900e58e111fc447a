/** RFC 9457 problem details of refused requests, with a hint and the refused fields. */

export interface FieldProblem {
  field: string;
  reason: string;
  /** What the reason is, or the value of the field that would be accepted. */
  code?: string;
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

/** A problem without an answer of the server. */
export function localProblem(title: string, detail = "", hint = ""): Problem {
  return { status: 0, title, detail, hint, problems: [] };
}

const UNREACHABLE = localProblem(
  "The server is not responding.",
  "The request may or may not have been received.",
  "Check that Gainline is running and that the network is up. The page updates automatically. Before you try again, see whether the request took effect.",
);

/** Gainline was updated, or the server was lost, after this tab was opened. */
export const PAGE_MISSING = localProblem(
  "This page could not be loaded.",
  "The server is unreachable, or it was updated after this tab was opened. Flights continue; nothing was changed.",
  "Try again. The page loads automatically when the server is back.",
);

export const BROKEN_PAGE = localProblem(
  "This page could not be displayed.",
  "Internal error. Flights continue; nothing was changed.",
  "Try again. Other pages still work. See the browser console for details.",
);

function text(value: unknown): string {
  return typeof value === "string" ? value : "";
}

function record(value: unknown): Record<string, unknown> {
  return typeof value === "object" && value !== null ? (value as Record<string, unknown>) : {};
}

function fieldProblems(value: unknown): FieldProblem[] {
  if (!Array.isArray(value)) return [];
  return value
    .map(record)
    .flatMap(({ field, reason, code }) =>
      typeof field === "string" && typeof reason === "string"
        ? [text(code) === "" ? { field, reason } : { field, reason, code: text(code) }]
        : [],
    );
}

/** The page's words where the API's title is the term of its protocol, by the type of the error or its status. */
const TITLES: Readonly<Record<string, string>> = {
  "urn:gainline:conflict": "Not possible now",
  400: "Unreadable request",
};

/** Convert the response of a failed request to a problem. */
export function problemFrom(status: number | undefined, body: unknown): Problem {
  if (status === undefined) return UNREACHABLE;
  const found = record(body);
  return {
    status,
    title:
      TITLES[text(found["type"])] ??
      TITLES[status] ??
      (text(found["title"]) || `The server returned status ${status}.`),
    detail: text(found["detail"]),
    hint: text(found["hint"]) || (status >= 500 ? "Try again. If it happens again, check the server log." : ""),
    problems: fieldProblems(found["problems"]),
  };
}

function isProblem(error: unknown): error is Problem {
  return typeof error === "object" && error !== null && "problems" in error && "hint" in error;
}

export function problemOf(error: unknown): Problem | null {
  if (error === null || error === undefined) return null;
  if (error instanceof ApiError) return error.problem;
  if (isProblem(error)) return error;
  return { ...UNREACHABLE, title: error instanceof Error ? error.message : UNREACHABLE.title };
}

/** The one of `fields` that a refused field is, or is part of. It may have any prefix (`body.definition.bounds.kp`). */
function ownerOf({ field }: FieldProblem, fields: readonly string[]): string | undefined {
  const owners = fields.filter((name) => `.${field}.`.includes(`.${name}.`));
  return owners.sort((one, other) => other.length - one.length)[0];
}

/** Reason per field. */
export function reasonsByField(problem: Problem | null, fields: readonly string[]): Record<string, string> {
  const reasons: Record<string, string> = {};
  for (const refused of problem?.problems ?? []) {
    const owner = ownerOf(refused, fields);
    if (owner !== undefined) reasons[owner] = reasons[owner] ? joined(reasons[owner], refused.reason) : refused.reason;
  }
  return reasons;
}

/** A reason about a share, in percent: `must be below 1, got 1.01` as `must be below 100 %, got 101 %`. */
export function inPercent(reason: string): string {
  return reason.replace(/[-−]?\d+(?:\.\d+)?/g, (share) => {
    const percent = Number((100 * Number(share.replace("−", "-"))).toPrecision(12));
    return `${percent}\u00a0%`.replace("-", "−");
  });
}

/** Join sentences by a space, and other texts by a semicolon. */
function joined(one: string, other: string): string {
  return /[.!?]$/.test(one) ? `${one} ${other}` : `${one}; ${other}`;
}

/** Refused fields that are not among `fields`. */
export function otherProblems(problem: Problem | null, fields: readonly string[]): FieldProblem[] {
  return (problem?.problems ?? []).filter((refused) => ownerOf(refused, fields) === undefined);
}

/**
 * A form's refusal in the form's own words where every reason is shown at a field of `labels`; otherwise as it is. Names
 * the fields at which a reason still stands; null once all of them have been edited.
 */
export function formProblem(
  error: unknown,
  labels: Readonly<Record<string, string>>,
  standing: Readonly<Record<string, unknown>> = reasonsByField(problemOf(error), Object.keys(labels)),
): Problem | null {
  const problem = problemOf(error);
  const fields = Object.keys(labels);
  if (problem === null || problem.problems.length === 0 || otherProblems(problem, fields).length > 0) return problem;
  const names = [...new Set(fields.filter((field) => field in standing).map((field) => labels[field]))];
  if (names.length === 0) return null;
  const title = `Correct the marked ${names.length === 1 ? "field" : "fields"}: ${names.join(", ")}.`;
  return { ...problem, title, detail: "", hint: "" };
}

/** Whether to retry a failed read: an unreachable server may return, a refusal is final. */
export function retries(failures: number, error: unknown): boolean {
  const problem = problemOf(error);
  return failures < 3 && (problem === null || problem.status === 0 || problem.status >= 500);
}
