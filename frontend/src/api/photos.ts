/** Note and photos of a flight. */

import { useMutation, useQuery, useQueryClient } from "@tanstack/react-query";
import { answer } from "./client";
import { addPhoto, deletePhoto, editTrial, listPhotos, type Trial } from "./generated";

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

export function useNote({ id, campaign_id, version }: Trial) {
  const queries = useQueryClient();
  return useMutation({
    mutationFn: (note: string) => answer(editTrial({ path: { trial_id: id }, body: { version, note } })),
    onSuccess: (after) => queries.setQueryData(["trial", id], after),
    onSettled: () => queries.invalidateQueries({ queryKey: ["campaign", campaign_id] }),
  });
}
