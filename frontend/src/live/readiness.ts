/** Readiness of a trial's vehicle: the server's answer, taken back by what only this page can tell. */

import { useWindowEvent } from "@mantine/hooks";
import { useQuery, useQueryClient } from "@tanstack/react-query";
import { useEffect, useRef, useState } from "react";
import { answer } from "../api/client";
import { getReadiness } from "../api/generated";
import { controlHeader, useOwnLease } from "../api/leases";
import type { TrialReadiness, Vehicle } from "../api/types";
import { momentNow, useConnection, useMoment } from "./store";
import { type Moment, secondsBetween } from "./vehicleStatus";

export type ReadinessStep = TrialReadiness["steps"][number];

const ASK_MS = 1000;
/** An older answer says nothing about now. Longer than a hold, so that a slow answer does not break it. */
const ANSWER_S = 4;
/** Without a tick for this long, the page or the whole tablet stood still. */
const STALL_S = 2;

export interface Loss {
  kind: TrialReadiness["losses"][number]["kind"] | "server away" | "page stalled";
  what: string;
  way_on: string;
}

export interface Readiness extends Omit<TrialReadiness, "losses"> {
  losses: readonly Loss[];
}

interface PageState {
  /** Age of the answer, in seconds. */
  answerAgeS: number;
  isServerAway: boolean;
  /** How long the page stood still after the answer, in seconds; 0 if it did not. */
  stalledS: number;
}

function pageLoss({ answerAgeS, isServerAway, stalledS }: PageState, isInFlight: boolean): Loss | null {
  if (stalledS > 0) {
    return {
      kind: "page stalled",
      what: `This page was frozen for ${Math.round(stalledS)} s. Its data is out of date.`,
      way_on: "The page is reading the current state.",
    };
  }
  if (!isServerAway && answerAgeS <= ANSWER_S) return null;
  return {
    kind: "server away",
    what: "The server is not responding. The data on this page is out of date.",
    way_on: isInFlight
      ? "An abort is sent until the server responds. Watch the vehicle. If it does not descend, use its own remote control."
      : "No commands can be sent from here. Check the network and the computer that runs Gainline.",
  };
}

/** Whether the flight is over, or its end unknown: nothing is left to be ready for. */
function isDown({ steps, lost }: TrialReadiness): boolean {
  return steps.includes("landed") || lost.includes("landed");
}

/** The server's answer, as far as the page may still rely on it. */
export function readinessNow(answered: TrialReadiness, page: PageState): Readiness {
  if (isDown(answered)) return answered;
  const isInFlight = answered.steps.includes("in flight");
  const loss = pageLoss(page, isInFlight);
  if (loss === null) return answered;
  const losses = [loss, ...answered.losses];
  if (isInFlight) return { ...answered, losses, is_ready: false };
  const kept: ReadinessStep[] = answered.steps.includes("control") ? ["control"] : [];
  const lost = [...answered.steps, ...answered.lost].filter((step) => !kept.includes(step));
  return { steps: kept, lost, losses, is_ready: false };
}

/** Whether control has ended by its lease, which no event reports, while the page still shows an operator. */
export function hasEndedUnseen(
  { losses }: Pick<TrialReadiness, "losses">,
  shown: readonly Pick<Vehicle, "id" | "control">[] | undefined,
  vehicleId: number | null,
): boolean {
  const operator = shown?.find(({ id }) => id === vehicleId)?.control ?? null;
  return operator !== null && losses.some(({ kind }) => kind === "control ended");
}

/** Interval until the server is asked again. A tab in the background asks only from the hold to the landing. */
function askAgainMs(answered: TrialReadiness | undefined): number | false {
  if (answered === undefined) return ASK_MS;
  const isWatched = document.visibilityState !== "hidden" || answered.steps.includes("held");
  return isWatched && !isDown(answered) ? ASK_MS : false;
}

/** Readiness at this moment; null until the first answer. */
export function useReadiness(trialId: number, vehicleId: number | null): Readiness | null {
  const token = useOwnLease(vehicleId)?.token ?? "";
  const queries = useQueryClient();
  const { state } = useConnection();
  const stall = useStall();
  const returnedAt = useReturn();
  const asked = useQuery({
    queryKey: ["trial", trialId, "readiness", token],
    queryFn: async () => {
      const at = momentNow();
      const headers = vehicleId === null ? {} : controlHeader(vehicleId);
      const readiness = await answer(getReadiness({ path: { trial_id: trialId }, headers }));
      if (hasEndedUnseen(readiness, queries.getQueryData(["vehicles"]), vehicleId)) {
        void queries.invalidateQueries({ queryKey: ["vehicles"] });
      }
      return { readiness, at };
    },
    refetchInterval: ({ state }) => askAgainMs(state.data?.readiness),
    refetchIntervalInBackground: true,
    refetchOnWindowFocus: "always",
    retry: false,
  });
  const now = useMoment();
  if (asked.data === undefined) return null;
  const { readiness, at } = asked.data;
  return readinessNow(readiness, {
    answerAgeS: secondsBetween(at, now),
    isServerAway: state === "away",
    stalledS: stallAfter(at, now, stall, returnedAt),
  });
}

interface Stall {
  seconds: number;
  endedAt: Moment;
}

/**
 * How long the page stood still after `at`, in seconds, by itself or in the background; 0 if it did not, and once the
 * answer to what it has asked since is overdue.
 */
function stallAfter(at: Moment, now: Moment, stall: Stall | null, returnedAt: Moment | null): number {
  const isLast = (end: Moment): boolean => end.wallMs > at.wallMs && secondsBetween(end, now) <= ANSWER_S;
  if (stall !== null && isLast(stall.endedAt)) return stall.seconds;
  if (returnedAt === null || !isLast(returnedAt)) return 0;
  const unreadS = secondsBetween(at, returnedAt);
  return unreadS > STALL_S ? unreadS : 0;
}

/** When this tab last came back from the background. */
function useReturn(): Moment | null {
  const [returnedAt, setReturnedAt] = useState<Moment | null>(null);
  useWindowEvent("visibilitychange", () => {
    if (document.visibilityState !== "hidden") setReturnedAt(momentNow());
  });
  return returnedAt;
}

/** The last time that this page stood still. */
function useStall(): Stall | null {
  const [stall, setStall] = useState<Stall | null>(null);
  const seen = useRef<Moment>(momentNow());
  useEffect(() => {
    const ticking = setInterval(() => {
      const now = momentNow();
      const seconds = secondsBetween(seen.current, now);
      seen.current = now;
      if (seconds > STALL_S) setStall({ seconds, endedAt: now });
    }, 250);
    return () => clearInterval(ticking);
  }, []);
  return stall;
}
