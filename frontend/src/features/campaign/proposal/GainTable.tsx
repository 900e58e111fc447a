import { Text, TextInput } from "@mantine/core";
import { Fragment } from "react";
import { gainText } from "../../../ui/format";
import { changeText, type GainRow, placeIn, sliderStep } from "./gainRows";
import classes from "./Proposal.module.css";

export interface GainEntry {
  texts: Readonly<Record<string, string>>;
  reasons: Readonly<Record<string, string>>;
  /** Gains that the gate refuses. */
  refused: readonly string[];
  onText: (name: string, text: string) => void;
}

interface Props {
  rows: readonly GainRow[];
  /** Whose gains the first column shows. */
  from: "Best gains" | "Best in bounds" | "Safe gains";
  unit: string;
  /** Makes the next gains inputs. */
  entry?: GainEntry;
}

/** Gains of the best flight, else the vehicle's safe ones, and next, with the change of each as a factor and within the bounds. */
export function GainTable({ rows, from, unit, entry }: Props) {
  return (
    <table className={classes["gains"]}>
      <caption className="visually-hidden">{from} and next gains</caption>
      <thead>
        <tr>
          <th scope="col">Gain{unit && ` (${unit})`}</th>
          <th scope="col">{from}</th>
          <th scope="col">Next</th>
          <th scope="col">Change</th>
        </tr>
      </thead>
      {rows.map((row) => {
        const { name, title, now, next } = row;
        return (
          <tbody key={name}>
            <tr>
              <th scope="row" title={title}>
                <GainName name={name} /> {title && <small>{title}</small>}
              </th>
              <td title={String(now)}>{gainText(now)}</td>
              <td title={next === null ? undefined : String(next)}>
                {entry === undefined ? next !== null && gainText(next) : <NextInput name={name} {...entry} />}
              </td>
              <td data-same={next === now || undefined}>{next !== null && changeText(now, next)}</td>
            </tr>
            <tr>
              <td colSpan={4}>
                <Bounds row={row} onText={entry?.onText} />
                {entry?.reasons[name] && (
                  <Text c="error" fz="fine" ta="left" role="alert">
                    {entry.reasons[name]}
                  </Text>
                )}
              </td>
            </tr>
          </tbody>
        );
      })}
    </table>
  );
}

/** A long name breaks after an underscore. */
function GainName({ name }: { name: string }) {
  return name.split("_").map((part, index) => (
    <Fragment key={part}>
      {index > 0 && "_"}
      {index > 0 && <wbr />}
      {part}
    </Fragment>
  ));
}

function NextInput({ name, texts, reasons, refused, onText }: GainEntry & { name: string }) {
  return (
    <TextInput
      aria-label={name}
      className={classes["entry"]}
      inputMode="decimal"
      autoComplete="off"
      value={texts[name] ?? ""}
      error={reasons[name] !== undefined || refused.includes(name)}
      onChange={(event) => onText(name, event.currentTarget.value)}
    />
  );
}

/** The old and the new gain on a scale of the bounds; a slider where the gain may be changed. */
function Bounds({ row, onText }: { row: GainRow; onText: GainEntry["onText"] | undefined }) {
  const { name, title, now, next, bounds } = row;
  if (bounds === null) return null;
  const [from, to] = [placeIn(bounds, now), placeIn(bounds, next ?? now)];
  return (
    <div className={classes["bounds"]}>
      <small className={classes["title"]} aria-hidden>
        {title}
      </small>
      <small>{gainText(bounds[0])}</small>
      <div className={classes["scale"]}>
        <span style={{ insetInlineStart: `${Math.min(from, to)}%`, width: `${Math.abs(to - from)}%` }} />
        <span className={classes["was"]} style={{ insetInlineStart: `${from}%` }} />
        {onText === undefined ? (
          <span className={classes["becomes"]} style={{ insetInlineStart: `${to}%` }} />
        ) : (
          <input
            type="range"
            aria-label={`Slider for ${name}`}
            min={bounds[0]}
            max={bounds[1]}
            step={sliderStep(row)}
            value={next ?? now}
            onChange={(event) => onText(name, event.currentTarget.value)}
          />
        )}
      </div>
      <small>{gainText(bounds[1])}</small>
    </div>
  );
}
