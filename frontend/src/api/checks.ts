/** Comparisons of recorded controllers with the replica. */

import { keepPreviousData, useInfiniteQuery, useMutation, useQuery, useQueryClient } from "@tanstack/react-query";
import { answer } from "./client";
import {
  type ControllerCheck,
  checkController,
  checkExampleController,
  deleteControllerCheck,
  type GetControllerCheckFigureData,
  getControllerCheck,
  getControllerCheckFigure,
  listControllerChecks,
} from "./generated";
import type { Theme } from "./queries";
import type { RecordFiles } from "./records";

export type { ControllerCheck, ControllerCheckSummary, SignalResult } from "./generated";
export type CheckFigureName = GetControllerCheckFigureData["path"]["name"];

const PAGE_SIZE = 20;

export function useChecks() {
  return useInfiniteQuery({
    queryKey: ["checks"],
    queryFn: ({ pageParam }) =>
      answer(listControllerChecks({ query: { limit: PAGE_SIZE, ...(pageParam ? { cursor: pageParam } : {}) } })),
    initialPageParam: "",
    getNextPageParam: (page) => page.next_cursor,
    placeholderData: keepPreviousData,
  });
}

/** A check never changes. */
export function useCheck(checkId: number) {
  return useQuery({
    queryKey: ["check", checkId],
    queryFn: () => answer(getControllerCheck({ path: { check_id: checkId } })),
    staleTime: Infinity,
  });
}

export function useCheckFigure(checkId: number, name: CheckFigureName, theme: Theme) {
  return useQuery({
    queryKey: ["check", checkId, "figure", name, theme],
    queryFn: () => answer(getControllerCheckFigure({ path: { check_id: checkId, name }, query: { theme } })),
    staleTime: Infinity,
  });
}

function useMade(): (check: ControllerCheck) => Promise<unknown> {
  const queries = useQueryClient();
  return (check) => {
    queries.setQueryData(["check", check.id], check);
    return queries.invalidateQueries({ queryKey: ["checks"] });
  };
}

export interface Recording extends RecordFiles {
  /** `KP,KI,KD`, if the log does not contain them. */
  gains?: string;
}

export function useCheckRecording() {
  return useMutation({
    mutationFn: ({ file, companion, gains }: Recording) =>
      answer(
        checkController({
          query: gains === undefined ? {} : { gains },
          body: { file, ...(companion === undefined ? {} : { companion }) },
        }),
      ),
    onSuccess: useMade(),
  });
}

export type RecordingCheck = ReturnType<typeof useCheckRecording>;

export function useCheckExample() {
  return useMutation({ mutationFn: () => answer(checkExampleController()), onSuccess: useMade() });
}

export function useDeleteCheck() {
  const queries = useQueryClient();
  return useMutation({
    mutationFn: (checkId: number) => answer(deleteControllerCheck({ path: { check_id: checkId } })),
    onSettled: () => queries.invalidateQueries({ queryKey: ["checks"] }),
  });
}
