import { Button, FileButton, Group, InputBase } from "@mantine/core";
import { IconCamera, IconTrash } from "@tabler/icons-react";
import { useState } from "react";
import { photoAddress, useNote, usePhotoActions, usePhotos } from "../../api/records";
import type { Trial } from "../../api/types";
import { ErrorNotice } from "../../ui/Notices";
import classes from "./Verdict.module.css";

const PICTURES = "image/jpeg,image/png,image/webp";

/** Note and photos of a flight; a tablet takes photos with its camera. */
export function FlightNotes({ trial }: { trial: Trial }) {
  const { data: photos = [], error } = usePhotos(trial.id);
  const { add, remove } = usePhotoActions(trial.id);
  const [asked, setAsked] = useState<number | null>(null);
  const doomed = photos.findIndex(({ id }) => id === asked);
  const kept = trial.note !== "" || photos.length > 0;
  return (
    <details className={classes["notes"]} open={kept || undefined}>
      <summary>Note and photos</summary>
      {/* The key keeps unsaved text when a review changes the trial's version. */}
      <Note key={`${trial.id} ${trial.note}`} trial={trial} />
      {photos.length > 0 && (
        <ul className={classes["photos"]}>
          {photos.map(({ id }, index) => (
            <li key={id}>
              <a href={photoAddress(trial.id, id)} target="_blank" rel="noreferrer">
                <img src={photoAddress(trial.id, id)} alt={`Flight ${trial.number}, ${index + 1}`} loading="lazy" />
              </a>
              <button
                type="button"
                aria-label={`Delete photo ${index + 1} of flight ${trial.number}`}
                aria-expanded={id === asked}
                onClick={() => setAsked(id === asked ? null : id)}
              >
                <IconTrash size={18} aria-hidden />
              </button>
            </li>
          ))}
        </ul>
      )}
      {asked !== null && doomed >= 0 && (
        <Group gap={8}>
          <p role="status">Delete photo {doomed + 1}? This cannot be undone.</p>
          <Button variant="default" onClick={() => setAsked(null)}>
            Cancel
          </Button>
          <Button color="red" loading={remove.isPending} onClick={() => remove.mutate(asked)}>
            Delete photo {doomed + 1}
          </Button>
        </Group>
      )}
      <FileButton accept={PICTURES} capture="environment" onChange={(file) => file && add.mutate(file)}>
        {(props) => (
          <Button
            {...props}
            variant="default"
            loading={add.isPending}
            leftSection={<IconCamera size={20} aria-hidden />}
          >
            Add photo
          </Button>
        )}
      </FileButton>
      <ErrorNotice error={add.error ?? remove.error ?? error} />
    </details>
  );
}

function Note({ trial }: { trial: Trial }) {
  const [note, setNote] = useState(trial.note);
  const save = useNote(trial);
  return (
    <form
      className={classes["note"]}
      onSubmit={(event) => {
        event.preventDefault();
        save.mutate(note);
      }}
    >
      <InputBase
        component="textarea"
        multiline
        label={`Note on flight ${trial.number}`}
        rows={2}
        maxLength={2000}
        value={note}
        onChange={(event) => setNote(event.currentTarget.value)}
      />
      {note !== trial.note && (
        <Button type="submit" loading={save.isPending}>
          Save note
        </Button>
      )}
      <ErrorNotice error={save.error} />
    </form>
  );
}
