import { Box, Text, TextInput } from "@mantine/core";
import { Fragment } from "react";
import { gainText } from "../../../ui/format";
import list from "../../../ui/ListTable.module.css";
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
    <table className={`${list["list"]} ${classes["gains"]}`}>
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
                {/* A long name breaks after an underscore. */}
                {name.split(/(?<=_)/).map((part) => (
                  <Fragment key={part}>
                    {part}
                    <wbr />
                  </Fragment>
                ))}{" "}
                {title && (
                  <Box component="small" fw={550}>
                    {title}
                  </Box>
                )}
              </th>
              <Box component="td" c="dimmed" title={String(now)}>
                {gainText(now)}
              </Box>
              <Box component="td" fz="title" fw={650} title={next?.toString()}>
                {entry ? (
                  <TextInput
                    aria-label={name}
                    w="clamp(80px, 20cqi, 96px)"
                    ml="auto"
                    inputMode="decimal"
                    autoComplete="off"
                    value={entry.texts[name] ?? ""}
                    error={name in entry.reasons || entry.refused.includes(name)}
                    onChange={(event) => entry.onText(name, event.currentTarget.value)}
                  />
                ) : (
                  next !== null && gainText(next)
                )}
              </Box>
              <Box component="td" fz="small" c={next === now ? "dimmed" : ""}>
                {next !== null && changeText(now, next)}
              </Box>
            </tr>
            <tr>
              <td colSpan={4} className={list["below"]}>
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

/** The old gain, a tick, and the new one, a dot, on a scale of the bounds; a slider where the gain may be changed. */
function Bounds({ row, onText }: { row: GainRow; onText: GainEntry["onText"] | undefined }) {
  const { name, title, now, next, bounds } = row;
  if (bounds === null) return null;
  const [from, to] = [placeIn(bounds, now), placeIn(bounds, next ?? now)];
  return (
    <div className={classes["bounds"]}>
      {onText === undefined && (
        <small className={classes["title"]} aria-hidden>
          {title}
        </small>
      )}
      <small>{gainText(bounds[0])}</small>
      <div className={classes["scale"]}>
        <svg width="100%" height={16} overflow="visible" strokeWidth={4} aria-hidden>
          <line x2="100%" y1={8} y2={8} stroke="var(--hairline)" />
          <line x1={`${from}%`} x2={`${to}%`} y1={8} y2={8} stroke="var(--prediction)" />
          <line x1={`${from}%`} x2={`${from}%`} y2={16} stroke="var(--edge)" strokeWidth={3} />
          {onText === undefined && <circle cx={`${to}%`} cy={8} r={7} fill="var(--prediction)" />}
        </svg>
        {onText && (
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
