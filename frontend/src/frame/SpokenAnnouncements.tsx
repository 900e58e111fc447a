import { type QueryClient, useQueryClient } from "@tanstack/react-query";
import { useEffect, useRef, useState } from "react";
import { answer } from "../api/client";
import { getCampaign, getTrial } from "../api/generated";
import type { Catalogue, Vehicle } from "../api/types";
import { speak } from "../live/speak";
import { justDown, type Known, type News, newsSentences, outcomeSentence, type Sentence } from "../live/speech";
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

/** Tells of flights and links as it happens: to screen readers always, aloud if that is wanted. */
export function SpokenAnnouncements() {
  const [wanted] = useSpeechWanted();
  const aloud = useRef(wanted);
  aloud.current = wanted;
  const queries = useQueryClient();
  const [lines, setLines] = useState<readonly Line[]>([]);
  useEffect(() => {
    let told: readonly Line[] = [];
    function tell(sentence: Sentence): void {
      const atMs = performance.now();
      if (told.some(({ text, atMs: earlier }) => text === sentence.text && atMs - earlier < AGAIN_MS)) return;
      told = [...told.slice(1 - SHOWN), { ...sentence, number: (told.at(-1)?.number ?? 0) + 1, atMs }];
      setLines(told);
      if (aloud.current) speak(sentence);
    }
    return followNews(queries, tell);
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
  return onNews((now) => {
    const earlier = before ?? now;
    before = now;
    for (const sentence of newsSentences(earlier, now, (vehicleId) => knownOf(queries, vehicleId))) tell(sentence);
    for (const trialId of justDown(earlier, now)) void readOutcome(queries, trialId, tell);
  });
}

function knownOf(queries: QueryClient, vehicleId: number): Known {
  const vehicle = queries.getQueryData<Vehicle[]>(["vehicles"])?.find(({ id }) => id === vehicleId);
  const limit = vehicle?.options["min_battery_v"];
  return { name: vehicle?.name ?? "the vehicle", minBatteryV: typeof limit === "number" ? limit : null };
}

/** What the record says of the flight, as soon as it says so. A server that is away is told of by itself. */
async function readOutcome(queries: QueryClient, trialId: number, tell: (sentence: Sentence) => void): Promise<void> {
  for (let look = 0; look < LOOKS; look += 1) {
    try {
      const trial = await answer(getTrial({ path: { trial_id: trialId } }));
      const campaign = await answer(getCampaign({ path: { campaign_id: trial.campaign_id } }));
      const units = unitsOf(queries.getQueryData<Catalogue>(["catalogue"]), campaign.definition.experiment);
      const outcome = outcomeSentence(trial.state, trial.error, units.error);
      if (outcome !== null) return tell(outcome);
    } catch {
      // The next look may succeed; the connection says by itself that it is gone.
    }
    await new Promise((done) => setTimeout(done, LOOK_MS));
  }
}
