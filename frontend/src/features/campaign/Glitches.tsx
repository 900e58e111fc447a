import type { Trial } from "../../api/types";
import { Aside } from "../../ui/Aside";
import { HelpTip } from "../../ui/HelpTip";
import { plusMinus } from "../../ui/uncertainty";

const KINDS = {
  acceleration: "Impossible acceleration",
  frozen: "Frozen samples",
  gap: "Gap",
  disagreement: "Sources disagree",
} as const;

/** Glitches of the record, and the error without them. The stored record is unchanged. */
export function Glitches({ trial, unit }: { trial: Trial; unit: string }) {
  const glitches = trial.glitches ?? [];
  if (glitches.length === 0) return null;
  return (
    <Aside tone="bad" mb={14} fz="small">
      <h3>
        The record has {glitches.length === 1 ? "a glitch" : `${glitches.length} glitches`}
        <HelpTip topic="glitch" />
      </h3>
      <ul>
        {glitches.map(({ kind, start_s, end_s, sentence }) => (
          <li key={`${kind} ${start_s}`} className="numbers">
            <strong>
              {KINDS[kind]}, {start_s.toFixed(2)} … {end_s.toFixed(2)} s.
            </strong>{" "}
            {sentence}
          </li>
        ))}
      </ul>
      {trial.repaired_error !== null && trial.repaired_error !== undefined && (
        <p className="numbers">
          Error as recorded {plusMinus(trial.error, null, unit)}, with the glitches bridged{" "}
          {plusMinus(trial.repaired_error, null, unit)}.
        </p>
      )}
    </Aside>
  );
}
