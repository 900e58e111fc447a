import { type QueryClient, useQueryClient } from "@tanstack/react-query";
import { useEffect, useRef, useState } from "react";
import { answer } from "../api/client";
import { getCampaign, getTrial } from "../api/generated";
import type { Catalogue, Vehicle } from "../api/types";
import { justDown, type Known, type News, newsSentences, outcomeSentence, type Sentence, speak } from "../live/speech";
import { onNews } from "../live/store";
import { unitsOf } from "../ui/units";
import { useSpeechWanted } from "../ui/usePreferences";

const AGAIN_MS = 5000;
const SHOWN = 3;
const LOOK_MS = 300;
const LOOKS = 40;

interface Line extends Sentence {
  number: number;
  atMs: number;
}

/** Announces flight and link events: to screen readers always, as speech if enabled. */
export function SpokenAnnouncements() {
  const [wanted] = useSpeechWanted();
  const aloud = useRef(wanted);
  aloud.current = wanted;
  const queries = useQueryClient();
  const [lines, setLines] = useState<readonly Line[]>([]);
  useEffect(() => {
    let announced: readonly Line[] = [];
    function announce(sentence: Sentence): void {
      const atMs = performance.now();
      if (announced.some(({ text, atMs: earlier }) => text === sentence.text && atMs - earlier < AGAIN_MS)) return;
      announced = [...announced.slice(1 - SHOWN), { ...sentence, number: (announced.at(-1)?.number ?? 0) + 1, atMs }];
      setLines(announced);
      if (aloud.current) speak(sentence);
    }
    return followNews(queries, announce);
  }, [queries]);
  return (
    <div className="visually-hidden" aria-live="polite">
      {lines.map(({ number, text }) => (
        <p key={number}>{text}</p>
      ))}
    </div>
  );
}

function followNews(queries: QueryClient, tell: (sentence: Sentence) => void): () => void {
  let before: News | null = null;
  const isArmed = (vehicleId: number): boolean => {
    const status = before?.vehicles.get(vehicleId)?.status;
    return status?.state === "connected" && status.armed === true;
  };
  return onNews((now) => {
    const earlier = before ?? now;
    before = now;
    for (const sentence of newsSentences(earlier, now, (vehicleId) => knownOf(queries, vehicleId))) tell(sentence);
    for (const trialId of justDown(earlier, now)) void readOutcome(queries, trialId, isArmed, tell);
  });
}

function knownOf(queries: QueryClient, vehicleId: number): Known {
  const vehicle = queries.getQueryData<Vehicle[]>(["vehicles"])?.find(({ id }) => id === vehicleId);
  const limit = vehicle?.options["min_battery_v"];
  return { name: vehicle?.name ?? "the vehicle", minBatteryV: typeof limit === "number" ? limit : null };
}

/** Announce the result of the flight once it is stored. A lost server is announced separately. */
async function readOutcome(
  queries: QueryClient,
  trialId: number,
  isArmed: (vehicleId: number) => boolean,
  tell: (sentence: Sentence) => void,
): Promise<void> {
  for (let look = 0; look < LOOKS; look += 1) {
    try {
      const trial = await answer(getTrial({ path: { trial_id: trialId } }));
      const campaign = await answer(getCampaign({ path: { campaign_id: trial.campaign_id } }));
      const units = unitsOf(queries.getQueryData<Catalogue>(["catalogue"]), campaign.definition.experiment);
      const outcome = outcomeSentence(trial.state, trial.error, units.error, isArmed(campaign.vehicle.id));
      if (outcome !== null) return tell(outcome);
    } catch {
      // Retried below; a lost connection is announced separately.
    }
    await new Promise((done) => setTimeout(done, LOOK_MS));
  }
}
