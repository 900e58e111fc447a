import { useCatalogue } from "../../../api/queries";
import type { Definition } from "../../../api/types";
import { Note } from "../../../ui/Note";
import { windowOf } from "../campaignSettings";

/** One line before a flight: how long it is scored, and so how long it flies. */
export function FlightWindow({ definition }: { definition: Definition }) {
  const seconds = windowOf(definition, useCatalogue().data);
  return seconds === null ? null : (
    <Note fz="small" className="numbers">
      Scored window: {seconds} s from the takeoff command
    </Note>
  );
}
