import { TextInput } from "@mantine/core";
import { Fragment } from "react";
import { gainText } from "../../../ui/format";
import classes from "../next-flight/NextFlight.module.css";
import { changeText, type GainRow, placeIn, sliderStep } from "./gainRows";

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
  titles: Readonly<Record<string, string>>;
  /** Makes the next gains inputs. */
  entry?: GainEntry | undefined;
}

/** More gains than this are shown without their titles where the screen is low. */
const FEW = 3;

/** Gains of the best flight, else the vehicle's safe ones, and next, with the change of each as a factor and within the bounds. */
export function GainTable({ rows, from, unit, titles, entry }: Props) {
  return (
    <table className={classes["gains"]} data-many={rows.length > FEW || undefined}>
      <caption className="visually-hidden">{from} and next gains</caption>
      <thead>
        <tr>
          <th scope="col">Gain{unit && ` (${unit})`}</th>
          <th scope="col">{from}</th>
          <th scope="col">Next</th>
          <th scope="col" className={classes["delta"]}>
            Change
          </th>
        </tr>
      </thead>
      {rows.map((row) => (
        <tbody key={row.name}>
          <tr>
            <th scope="row" title={titles[row.name]}>
              <GainName name={row.name} /> {titles[row.name] && <small>{titles[row.name]}</small>}
            </th>
            <td className={classes["now"]} title={String(row.now)}>
              {gainText(row.now)}
            </td>
            <td className={classes["next"]} title={row.next === null ? undefined : String(row.next)}>
              {entry === undefined ? row.next !== null && gainText(row.next) : <NextInput name={row.name} {...entry} />}
            </td>
            <td className={classes["delta"]} data-same={row.next === row.now || undefined}>
              {row.next !== null && changeText(row.now, row.next)}
            </td>
          </tr>
          <tr>
            <td colSpan={4}>
              <Bounds row={row} title={titles[row.name] ?? ""} entry={entry} />
              {entry?.reasons[row.name] && (
                <small className={classes["reason"]} role="alert">
                  {entry.reasons[row.name]}
                </small>
              )}
            </td>
          </tr>
        </tbody>
      ))}
    </table>
  );
}

/** A long name breaks after an underscore. */
function GainName({ name }: { name: string }) {
  const [first, ...others] = name.split("_");
  return (
    <>
      {first}
      {others.map((part) => (
        <Fragment key={part}>
          _<wbr />
          {part}
        </Fragment>
      ))}
    </>
  );
}

function NextInput({ name, texts, reasons, refused, onText }: GainEntry & { name: string }) {
  return (
    <TextInput
      aria-label={name}
      classNames={{ input: classes["entry"] ?? "" }}
      inputMode="decimal"
      autoComplete="off"
      value={texts[name] ?? ""}
      error={reasons[name] !== undefined || refused.includes(name)}
      onChange={(event) => onText(name, event.currentTarget.value)}
    />
  );
}

/** The old and the new gain on a scale of the bounds; a slider where the gain may be changed. */
function Bounds({ row, title, entry }: { row: GainRow; title: string; entry: GainEntry | undefined }) {
  const { name, now, next, bounds } = row;
  if (bounds === null) return null;
  const [from, to] = [placeIn(bounds, now), placeIn(bounds, next ?? now)];
  return (
    <div className={classes["bounds"]} data-entry={entry !== undefined || undefined}>
      <small className={classes["compactTitle"]} aria-hidden>
        {title}
      </small>
      <small>{gainText(bounds[0])}</small>
      <div className={classes["scale"]}>
        <span
          className={classes["moved"]}
          style={{ insetInlineStart: `${Math.min(from, to)}%`, width: `${Math.abs(to - from)}%` }}
        />
        <span className={classes["was"]} style={{ insetInlineStart: `${from}%` }} />
        {entry === undefined ? (
          <span className={classes["becomes"]} style={{ insetInlineStart: `${to}%` }} />
        ) : (
          <input
            type="range"
            aria-label={`Slider for ${name}`}
            min={bounds[0]}
            max={bounds[1]}
            step={sliderStep(row)}
            value={next ?? now}
            onChange={(event) => entry.onText(name, event.currentTarget.value)}
          />
        )}
      </div>
      <small>{gainText(bounds[1])}</small>
    </div>
  );
}
