/** Flights in progress, and their abort. */

import { useQuery } from "@tanstack/react-query";
import { createContext, use, useCallback, useEffect, useRef, useState } from "react";
import { answer } from "../api/client";
import { abortTrial, getCampaign, listCampaigns } from "../api/generated";
import { leasesNow, type OwnLease } from "../api/leases";
import { problemOf } from "../api/problems";
import type { Vehicle } from "../api/types";
import { useVehicles } from "../api/vehicles";
import { liveFlightsNow } from "./store";
import { isAbortStep } from "./vehicleStatus";

export interface FlyingCampaign {
  campaignId: number;
  trialId: number;
  trialNumber: number;
  name: string;
  vehicleId: number;
  vehicleName: string;
  isReal: boolean;
  /** Whether the vehicle is registered, with a process that keeps its link. */
  hasLink: boolean;
}

async function readFlying(): Promise<FlyingCampaign[]> {
  const page = await answer(listCampaigns({ query: { state: ["flying"], limit: 20 } }));
  const campaigns = await Promise.all(page.items.map(({ id }) => answer(getCampaign({ path: { campaign_id: id } }))));
  return campaigns.flatMap(({ id, name, vehicle, flying }) =>
    flying === null
      ? []
      : [
          {
            campaignId: id,
            trialId: flying.trial_id,
            trialNumber: flying.trial_number,
            name,
            vehicleId: vehicle.id,
            vehicleName: vehicle.registered ? vehicle.name : vehicle.title,
            isReal: vehicle.is_real,
            hasLink: vehicle.registered,
          },
        ],
  );
}

export function useFlying(): FlyingCampaign[] {
  return useQuery({ queryKey: ["flying"], queryFn: readFlying }).data ?? [];
}

const AGAIN_MS = 400;

type Commanded = Pick<Vehicle, "is_real" | "registered" | "control">;

/** The reason of an abort from this tab, for the server to use its own where the operator pressed it. */
export function abortReason(vehicle: Commanded | undefined, own: OwnLease | undefined): { reason?: string } {
  if (vehicle === undefined) return {};
  const { control, is_real, registered } = vehicle;
  const isOperators =
    control === null ? own !== undefined || !(is_real && registered) : own?.operator === control.operator;
  return isOperators ? {} : { reason: "aborted from a browser that was not in control" };
}

/** Why the worker did not accept the abort; null if it did. Without the hint, because the page repeats it itself. */
async function askToAbort(trialId: number, body: { reason?: string }): Promise<string | null> {
  try {
    const { accepted, sentence } = await answer(abortTrial({ path: { trial_id: trialId }, body }));
    return accepted ? null : sentence;
  } catch (error) {
    return problemOf(error)?.detail ?? "";
  }
}

/** The trials of `ids` that are still under way; the same set if all are. */
export function stillUnderWay(ids: ReadonlySet<number>, underWay: ReadonlySet<number>): ReadonlySet<number> {
  const kept = [...ids].filter((id) => underWay.has(id));
  return kept.length === ids.size ? ids : new Set(kept);
}

/**
 * Abort by trial id. The request is repeated until the worker accepts it or the flight is over. `accepted` are the
 * flights whose abort it has accepted; both forget a flight that is over, because its trial may fly again. `trouble` is
 * the reason why one has not been accepted yet.
 */
export function useAbort(flying: readonly FlyingCampaign[]) {
  const [asked, setAsked] = useState<ReadonlySet<number>>(new Set());
  const [accepted, setAccepted] = useState<ReadonlySet<number>>(new Set());
  const [trouble, setTrouble] = useState<string | null>(null);
  const vehicles = useVehicles().data;
  const inTheAir = useRef<ReadonlySet<number>>(new Set());
  const reasonOf = useRef<(trialId: number) => { reason?: string }>(() => ({}));
  reasonOf.current = (trialId) => {
    const vehicleId = flying.find((one) => one.trialId === trialId)?.vehicleId;
    if (vehicleId === undefined) return {};
    return abortReason(
      vehicles?.find(({ id }) => id === vehicleId),
      leasesNow().get(vehicleId),
    );
  };
  inTheAir.current = new Set(flying.map(({ trialId }) => trialId));

  const tell = useCallback(async (trialId: number): Promise<void> => {
    const refusal = await askToAbort(trialId, reasonOf.current(trialId));
    const over = !inTheAir.current.has(trialId) && !liveFlightsNow().some((flight) => flight.trialId === trialId);
    setTrouble(over ? null : refusal);
    if (refusal === null) setAccepted((before) => new Set([...before, trialId]));
    if (refusal !== null && !over) setTimeout(() => void tell(trialId), AGAIN_MS);
  }, []);

  const press = useCallback(
    (trialIds: readonly number[]): void => {
      setAsked((before) => new Set([...before, ...trialIds]));
      for (const trialId of trialIds) void tell(trialId);
    },
    [tell],
  );

  useEffect(() => {
    const underWay = new Set([...flying, ...liveFlightsNow()].map(({ trialId }) => trialId));
    setAsked((before) => stillUnderWay(before, underWay));
    setAccepted((before) => stillUnderWay(before, underWay));
    if (flying.length === 0) setTrouble(null);
  }, [flying]);

  return { asked, accepted, trouble, press };
}

export type AbortControl = ReturnType<typeof useAbort>;

/** The abort of the flights in progress, for the pages in the frame. */
export const AbortContext = createContext<AbortControl | null>(null);

export function useAbortControl(): AbortControl {
  const abort = use(AbortContext);
  if (abort === null) throw new Error("a page outside the frame");
  return abort;
}

/**
 * How far an abort has come. not confirmed: it was refused, or perhaps not received, and is repeated. landing, link
 * lost: the flight was ended without it, at a limit or because its link is lost.
 */
export type AbortStage = "none" | "sending" | "not confirmed" | "accepted" | "landing" | "link lost";

const UNASKED: Readonly<Record<string, AbortStage>> = { "abort-land": "landing", "link lost": "link lost" };

/** Whether the flight ends before its record is complete: an abort is accepted, or the vehicle's `step` shows it, which
 * may be known before the answer to the abort. */
export function isCutShort(stage: AbortStage, step?: string): boolean {
  return stage === "accepted" || isAbortStep(step);
}

/** `step` is the vehicle's. */
export function abortStage(
  trialId: number,
  { asked, accepted, trouble }: Omit<AbortControl, "press">,
  step?: string,
): AbortStage {
  if (!asked.has(trialId)) return UNASKED[step ?? ""] ?? "none";
  if (accepted.has(trialId)) return "accepted";
  return trouble === null ? "sending" : "not confirmed";
}

export const ABORT_LABELS: Record<AbortStage, string> = {
  none: "ABORT",
  sending: "ABORTING",
  "not confirmed": "NOT CONFIRMED",
  accepted: "ABORTING",
  landing: "LANDING",
  "link lost": "LINK LOST",
};

const LANDING = "Land is repeated until the vehicle descends.";
const GAINS_AFTER = "The safe gains are restored after the landing at the latest.";
const BY_HAND = "If it does not descend, use its own remote control.";

const ABORT_SAYS: Record<AbortStage, string> = {
  none: "ABORT or Space ends the flight immediately: the safe gains are sent, then Land until the vehicle descends.",
  sending: "Sending the abort to the worker.",
  "not confirmed": "The abort is not confirmed. It is sent again until the worker confirms it.",
  accepted: `${LANDING} ${GAINS_AFTER}`,
  landing: `${LANDING} ${GAINS_AFTER}`,
  "link lost": `${LANDING} ${BY_HAND}`,
};

/** What ABORT does, or is doing, while the worker can be reached or not, and the vehicle's link is lost or not. */
export function abortText(stage: AbortStage, isReached: boolean, isLinkLost: boolean): string {
  if (stage === "sending" || stage === "not confirmed") return ABORT_SAYS[stage];
  if (!isReached && stage === "accepted")
    return `The abort is confirmed, but the worker cannot be reached now. Watch the vehicle. ${BY_HAND}`;
  if (!isReached)
    return `The worker cannot be reached. An abort is sent until it confirms it. Watch the vehicle. ${BY_HAND}`;
  if (!isLinkLost) return ABORT_SAYS[stage];
  const what = stage === "none" ? "An abort is sent until the vehicle descends." : LANDING;
  return `Nothing is received from the vehicle. ${what} ${BY_HAND}`;
}
