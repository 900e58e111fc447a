/** Analysed logs: each is stored for seven days, or kept as a flight of a vehicle. */

import { type QueryClient, type QueryKey, skipToken, useMutation, useQuery } from "@tanstack/react-query";
import { answer } from "./client";
import {
  analyzeExample,
  analyzeLog,
  compareLogs,
  deleteLog,
  getLogAnalysis,
  getLoggedVehicle,
  getTrend,
  keepLog,
  type LogPlace,
  listFailureShapes,
  listLoggedVehicles,
  listLogs,
  renameLoggedVehicle,
  startCampaign,
  startStoredCampaign,
  storeLogFile,
} from "./generated";
import { everyPage, usePages } from "./pages";
import { useFigure } from "./queries";
import type { RecordFiles } from "./records";

export type {
  AnalysedLog,
  Description,
  Grade,
  LogAnalysis,
  LogComparison,
  LoggedVehicle,
  LoggedVehicleDetails,
  LogNumbers,
  LogPlace,
  ParameterChange,
  PartTexts,
} from "./generated";

/** File types of the file chooser. A .log file belongs to Paparazzi's .data file; traces are .csv or .csv.gz. */
export const ANALYSED_FILES = ".bin,.ulg,.tlog,.data,.log,.csv,.gz,text/csv";

export interface LogToAnalyse {
  /** Null: the example that comes with Gainline. */
  files: RecordFiles | null;
  /** `KP,KI,KD` as flown, if the log does not contain them. */
  gains?: string;
  /** System id of one of several vehicles; null: the one with the most to learn. */
  vehicle?: number | null;
}

/** What this tab alone knows of a log that it has sent. */
interface SentLog {
  files: RecordFiles | null;
  /** Whether its answer was stored before it was sent. */
  isRepeated: boolean;
}

const NOT_SENT: SentLog = { files: null, isRepeated: false };

// The event stream tells nothing of logs: another tab's changes are read when this one is seen again.
const LOGS = "logs";
const READ = { staleTime: 10_000 };
const answerKey = (logId: number) => [LOGS, "answer", logId];
const sentKey = (logId: number) => ["sent-log", logId];

const changed = (queries: QueryClient) => queries.invalidateQueries({ queryKey: [LOGS] });

/** Analyse a log; its answer is then in the cache. */
export function useAnalyzeLog() {
  return useMutation({
    mutationFn: async ({ files, gains = "", vehicle = null }: LogToAnalyse) => {
      const call = files === null ? analyzeExample() : analyzeLog({ body: { ...files }, query: { gains, vehicle } });
      const analysis = await answer(call);
      const askedAt = Date.parse((await call).response?.headers.get("Date") ?? "");
      return { analysis, sent: { files, isRepeated: Date.parse(analysis.log.analysed_at) < askedAt } };
    },
    onSuccess: ({ analysis, sent }, _log, _before, { client }) => {
      void changed(client);
      client.setQueryData<SentLog>(sentKey(analysis.log.id), sent);
      client.setQueryData(answerKey(analysis.log.id), analysis);
    },
  });
}

/** The file of a log while this tab has it. */
export function useSentLog(logId: number): SentLog {
  return useQuery<SentLog>({ queryKey: sentKey(logId), queryFn: skipToken, gcTime: Infinity }).data ?? NOT_SENT;
}

/** Something about logs, by its key. */
function useRead<Answer>(queryKey: QueryKey, read: () => Promise<Answer>) {
  return useQuery({ queryKey, queryFn: read, ...READ });
}

export const useLogAnalysis = (logId: number) =>
  useRead(answerKey(logId), () => answer(getLogAnalysis({ path: { log_id: logId } })));

const PAGE_SIZE = 20;

/** Logs, the newest flight first. */
export function useLogs(kept: boolean) {
  return usePages([LOGS, { kept }], PAGE_SIZE, (page) => answer(listLogs({ query: { kept, ...page } })), READ);
}

/** All logs of a vehicle, the newest first. */
export const useLogsOf = (vehicle: number) =>
  useRead([LOGS, "of", vehicle], () => everyPage((page) => answer(listLogs({ query: { vehicle, ...page } }))));

export const useLoggedVehicles = () => useRead([LOGS, "vehicles"], () => answer(listLoggedVehicles()));

export const useLoggedVehicle = (vehicleId: number) =>
  useRead([LOGS, "vehicle", vehicleId], () => answer(getLoggedVehicle({ path: { vehicle_id: vehicleId } })));

/** The atlas of failure shapes, which a new version alone changes. */
export const useFailureShapes = () =>
  useQuery({ queryKey: ["failure-shapes"], queryFn: () => answer(listFailureShapes()) });

export function useTrend(vehicleId: number) {
  return useFigure(
    [LOGS, "trend", vehicleId],
    (theme) => answer(getTrend({ path: { vehicle_id: vehicleId }, query: { theme } })),
    READ,
  );
}

export const useLogComparison = (logId: number, before: number) =>
  useRead([LOGS, "comparison", logId, before], () =>
    answer(compareLogs({ path: { log_id: logId }, query: { before } })),
  );

interface Kept {
  name: string;
  /** To be stored too. */
  files: RecordFiles | null;
}

/** Keep a log as a flight of the vehicle with that name, with or without its file. */
export function useKeepLog(logId: number) {
  const path = { log_id: logId };
  return useMutation({
    mutationFn: async ({ name, files }: Kept): Promise<LogPlace> => {
      const place = await answer(keepLog({ path, body: { name } }));
      return files === null ? place : answer(storeLogFile({ path, body: { ...files } }));
    },
    onSettled: (_answer, _error, _sent, _before, { client }) => changed(client),
  });
}

/** `onDeleted` is called even if the log's page is gone by then. */
export function useDeleteLog(logId: number, onDeleted: () => void) {
  return useMutation({
    mutationFn: () => answer(deleteLog({ path: { log_id: logId } })),
    onSuccess: (_none, _sent, _before, { client }) => {
      onDeleted();
      client.removeQueries({ queryKey: answerKey(logId) });
      void changed(client);
    },
  });
}

export function useRenameVehicle(vehicleId: number) {
  return useMutation({
    mutationFn: (name: string) => answer(renameLoggedVehicle({ path: { vehicle_id: vehicleId }, body: { name } })),
    onSettled: (_answer, _error, _sent, _before, { client }) => changed(client),
  });
}

interface CampaignStart {
  logId: number;
  /** Null: what is stored suffices. */
  files: RecordFiles | null;
  vehicle: number | null;
  loggedVehicle: number | null;
}

/** Create a campaign with the takeoffs of a Paparazzi log, or of a copter with the gains proposed from its log. */
export function useStartCampaign() {
  return useMutation({
    mutationFn: ({ logId, files, vehicle, loggedVehicle }: CampaignStart) =>
      answer(
        files === null
          ? startStoredCampaign({ path: { log_id: logId }, query: { vehicle } })
          : startCampaign({ body: { ...files }, query: { vehicle, logged_vehicle: loggedVehicle } }),
      ),
  });
}

/** Addresses of a log's downloads. */
export const logFile = (logId: number, name: "export.json" | "export.html" | "file"): string =>
  `/api/log-analyses/${logId}/${name}`;
