import { ActionIcon, Box, Button, FileButton, Group, InputBase, Stack } from "@mantine/core";
import { readSessionStorageValue, useSessionStorage } from "@mantine/hooks";
import { IconCamera, IconTrash } from "@tabler/icons-react";
import { useEffect, useRef, useState } from "react";
import { photoAddress, useNote, usePhotoActions, usePhotos } from "../../../api/records";
import type { Trial } from "../../../api/types";
import { ErrorNotice } from "../../../ui/Notices";
import classes from "./FlightNotes.module.css";

const PICTURES = "image/jpeg,image/png,image/webp";
const LONGEST_NOTE = 2000;
const COUNTED_FROM = 1800;

/** The time in the record, in seconds since the command, at which a line of the note is to be pinned. */
export interface NotePin {
  timeS: number;
}

interface Props {
  trial: Trial;
  /** A new pin adds its line to the note. */
  pin?: NotePin | null;
}

/** Note and photos of a flight; a tablet takes photos with its camera. */
export function FlightNotes({ trial, pin = null }: Props) {
  const { data: photos = [], error } = usePhotos(trial.id);
  const { add, remove } = usePhotoActions(trial.id);
  const [asked, setAsked] = useState<number | null>(null);
  const doomed = photos.findIndex(({ id }) => id === asked);
  const [hasDraft] = useState(() => readSessionStorageValue({ key: keyOf(trial) }) !== undefined);
  const kept = hasDraft || trial.note !== "" || photos.length > 0 || pin !== null;
  return (
    <details open={kept || undefined}>
      <summary>Note and photos</summary>
      <Stack gap={12} align="start">
        {/* The key keeps unsaved text when a review changes the trial's version. */}
        <Note key={`${trial.id} ${trial.note}`} trial={trial} pin={pin} />
        {photos.length > 0 && (
          <Group component="ul" gap={10}>
            {photos.map(({ id }, index) => (
              <Box component="li" key={id} pos="relative">
                <a href={photoAddress(trial.id, id)} target="_blank" rel="noreferrer">
                  <img
                    className={classes["photo"]}
                    src={photoAddress(trial.id, id)}
                    alt={`Flight ${trial.number}, ${index + 1}`}
                    loading="lazy"
                  />
                </a>
                <ActionIcon
                  variant="default"
                  pos="absolute"
                  right={0}
                  bottom={0}
                  c={id === asked ? "error" : ""}
                  aria-label={`Delete photo ${index + 1} of flight ${trial.number}`}
                  aria-expanded={id === asked}
                  onClick={() => setAsked(id === asked ? null : id)}
                >
                  <IconTrash size={18} aria-hidden />
                </ActionIcon>
              </Box>
            ))}
          </Group>
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
      </Stack>
    </details>
  );
}

function Note({ trial, pin }: { trial: Trial; pin: NotePin | null }) {
  const [note, setNote, forget] = useSessionStorage({
    key: keyOf(trial),
    defaultValue: trial.note,
    getInitialValueInEffect: false,
  });
  const text = useRef<HTMLTextAreaElement>(null);
  const pinned = useRef(pin);
  useEffect(() => {
    if (pin === null || pinned.current === pin) return;
    pinned.current = pin;
    setNote((before) => withPin(before, pin.timeS));
    text.current?.focus();
  }, [pin, setNote]);
  // What was typed since is kept; the field shows what was sent until the trial has it.
  const save = useNote(trial, (sent) => note === sent && sessionStorage.removeItem(keyOf(trial)));
  const isTooLong = note.length > LONGEST_NOTE;
  return (
    <Stack
      component="form"
      gap={8}
      align="start"
      w="100%"
      onSubmit={(event) => {
        event.preventDefault();
        save.mutate(note);
      }}
    >
      <InputBase
        component="textarea"
        ref={text}
        w="100%"
        classNames={{ input: classes["text"] }}
        description="A line that starts with a time, such as “2.4 s: wobble”, is marked on the record chart."
        multiline
        label={`Note on flight ${trial.number}`}
        rows={2}
        error={isTooLong}
        value={note}
        onChange={({ currentTarget: { value } }) => (value === trial.note ? forget() : setNote(value))}
      />
      {note.length >= COUNTED_FROM && (
        <p role="status">
          {note.length} of at most {LONGEST_NOTE} characters
        </p>
      )}
      {note !== trial.note && (
        <Button type="submit" loading={save.isPending} disabled={isTooLong}>
          Save note
        </Button>
      )}
      <ErrorNotice error={save.error} />
    </Stack>
  );
}

/** The note with another line, which begins with a time. */
function withPin(note: string, timeS: number): string {
  const before = note.trimEnd();
  return `${before}${before && "\n"}${timeS.toFixed(1)} s: `;
}

/** Where the unsaved note of a flight is kept in this tab while other pages are open. */
const keyOf = ({ id }: Trial): string => `note ${id}`;
