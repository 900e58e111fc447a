/** Numeric jobs, among them the reproductions of the paper. */

import { keepPreviousData, useMutation, useQuery, useQueryClient } from "@tanstack/react-query";
import { answer } from "./client";
import {
  cancelJob,
  getJobLog,
  getReproduction,
  getReproductionFigure,
  type JobState,
  listJobs,
  listReproductions,
  retryJob,
  runReproduction,
} from "./generated";
import { usePages } from "./pages";
import { useFigure } from "./queries";

export type { Job, JobState, ReproductionSummary, Row as ReproductionRow } from "./generated";

export const JOBS_PAGE = 20;

export function useJobs(state: readonly JobState[], limit: number) {
  return usePages(["jobs", ...state, limit], limit, (page) =>
    answer(listJobs({ query: { state: [...state], ...page } })),
  );
}

/** The worker's log of a job; refetched with the jobs. */
export function useJobLog(jobId: number) {
  return useQuery({
    queryKey: ["jobs", "log", jobId],
    queryFn: () => answer(getJobLog({ path: { job_id: jobId } })),
  });
}

export function useReproductions() {
  return useQuery({ queryKey: ["reproductions"], queryFn: () => answer(listReproductions()) });
}

/** A result never changes; a newer run has another `jobId`. */
export function useReproductionResult(name: string, jobId: number | null) {
  return useQuery({
    queryKey: ["reproduction", name, jobId],
    queryFn: () => answer(getReproduction({ path: { name } })),
    enabled: jobId !== null,
    placeholderData: keepPreviousData,
    staleTime: Infinity,
  });
}

export function useReproductionFigure(name: string, figure: string, jobId: number) {
  return useFigure(
    ["reproduction", name, "figure", figure, jobId],
    (theme) => answer(getReproductionFigure({ path: { name, figure }, query: { theme } })),
    { staleTime: Infinity },
  );
}

/** A request that changes jobs. */
function useJobMutation<Variables, Answer>(mutationFn: (variables: Variables) => Promise<Answer>) {
  const queries = useQueryClient();
  const onSettled = () =>
    Promise.all(["jobs", "reproductions"].map((key) => queries.invalidateQueries({ queryKey: [key] })));
  return useMutation({ mutationFn, onSettled });
}

export const useRunReproduction = () =>
  useJobMutation(({ name, full = false }: { name: string; full?: boolean }) =>
    answer(runReproduction({ path: { name }, body: { full } })),
  );

export const useCancelJob = () => useJobMutation((job_id: number) => answer(cancelJob({ path: { job_id } })));

export const useRetryJob = () => useJobMutation((job_id: number) => answer(retryJob({ path: { job_id } })));
