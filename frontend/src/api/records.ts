/** Records of flights made elsewhere: their files, and the server's questions about them. */

import { useMutation, useQuery, useQueryClient } from "@tanstack/react-query";
import { answer } from "./client";
import { addPhoto, deletePhoto, editTrial, listPhotos, type Reading, type Trial } from "./generated";
import type { Problem } from "./problems";

/** File types of the file chooser. A .log file belongs to Paparazzi's .data file. */
export const RECORD_FILES = ".csv,.tlog,.bin,.ulg,.data,.log,text/csv";

export interface RecordFiles {
  file: File;
  companion?: File;
}

export interface Takeoff {
  number: number;
  summary: string;
}

/** The record among the chosen files, and its companion; null when there is none. */
export function recordOf(files: readonly File[]): RecordFiles | null {
  const isCompanion = (file: File): boolean => file.name.toLowerCase().endsWith(".log");
  const file = files.find((one) => !isCompanion(one)) ?? files[0];
  if (file === undefined) return null;
  return { file, companion: files.find((one) => one !== file && isCompanion(one)) };
}

/** The takeoffs of a log from which the server requests a choice. */
export function takeoffsIn(problem: Problem | null): Takeoff[] {
  return (problem?.problems ?? []).flatMap(({ field, reason }) => {
    const [, number, summary] = /^(\d+): (.*)$/.exec(reason) ?? [];
    return field === "takeoff" && number !== undefined && summary !== undefined
      ? [{ number: Number(number), summary }]
      : [];
  });
}

/** What a person may accept all the same: other gains than planned, or a record that cannot be scored. */
export function confirmationIn(problem: Problem | null): "confirm" | "invalid" | null {
  const fields = (problem?.problems ?? []).map(({ field }) => field);
  return (["confirm", "invalid"] as const).find((field) => fields.includes(field)) ?? null;
}

/** How a record may be read that the server takes for no flight of the campaign as it is. */
export const READINGS: Readonly<Record<Reading, string>> = {
  milliseconds: "time in milliseconds",
  microseconds: "time in microseconds",
  centimetres: "altitude in centimetres",
  millimetres: "altitude in millimetres",
  feet: "altitude in feet",
  "down-positive": "altitude positive down",
  "other-datum": "altitude above another level",
};

/** The readings that the server offers; all of them together make the record a flight of the campaign. */
export function readingsIn(problem: Problem | null): Reading[] {
  const offered = (problem?.problems ?? []).filter(({ field }) => field === "reads_as").map(({ code }) => code);
  return (Object.keys(READINGS) as Reading[]).filter((reading) => offered.includes(reading));
}

export const photoAddress = (trialId: number, photoId: number): string => `/api/trials/${trialId}/photos/${photoId}`;

export function usePhotos(trialId: number) {
  return useQuery({
    queryKey: ["trial", trialId, "photos"],
    queryFn: () => answer(listPhotos({ path: { trial_id: trialId } })),
  });
}

export function usePhotoActions(trialId: number) {
  const queries = useQueryClient();
  const onSettled = () => queries.invalidateQueries({ queryKey: ["trial", trialId, "photos"] });
  return {
    add: useMutation({
      mutationFn: (file: File) => answer(addPhoto({ path: { trial_id: trialId }, body: { file } })),
      onSettled,
    }),
    remove: useMutation({
      mutationFn: (photoId: number) => answer(deletePhoto({ path: { trial_id: trialId, photo_id: photoId } })),
      onSettled,
    }),
  };
}

/** `onSaved` is called with the text that was sent, also when its form is gone by then. */
export function useNote({ id, campaign_id, version }: Trial, onSaved: (sent: string) => void) {
  const queries = useQueryClient();
  return useMutation({
    mutationFn: (note: string) => answer(editTrial({ path: { trial_id: id }, body: { version, note } })),
    onSuccess: (after, sent) => {
      onSaved(sent);
      queries.setQueryData(["trial", id], after);
    },
    onSettled: () => queries.invalidateQueries({ queryKey: ["campaign", campaign_id] }),
  });
}
