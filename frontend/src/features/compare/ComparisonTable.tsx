import { ActionIcon, Anchor } from "@mantine/core";
import { IconArrowBarToUp, IconX } from "@tabler/icons-react";
import type { ReactNode } from "react";
import { Link } from "react-router";
import type { ComparedFlight, FlightComparison, FlightDifference, FlightPair } from "../../api/compare";
import type { FigureCard } from "../../api/types";
import type { PlotlyFigure } from "../../charts/traces";
import { StateBadge, VehicleBadge } from "../../ui/Badges";
import { count, gainText, NOTHING, sharesText } from "../../ui/format";
import { HelpTip } from "../../ui/HelpTip";
import { Note } from "../../ui/Note";
import { ScrollTable } from "../../ui/ScrollTable";
import { trialStateLabel } from "../../ui/states";
import { hasStepResponse, MEASURES, measureText } from "../../ui/stepResponse";
import { Time } from "../../ui/Time";
import { confidenceText, plusMinus } from "../../ui/uncertainty";
import { VERDICTS } from "../campaign/verdict/verdict";
import classes from "./Compare.module.css";
import { againstFirst } from "./chosenFlights";

interface Props {
  comparison: FlightComparison;
  pens: ReadonlyMap<number, LineStyle>;
  onFirst: (trial: number) => void;
  onRemove: (trial: number) => void;
}

/** The flights in the order of the URL: error, comparison with the first, differences. */
export function ComparisonTable({ comparison, pens, onFirst, onRemove }: Props) {
  const { flights, gains, pairs, error_unit: unit } = comparison;
  const [first] = flights;
  if (first === undefined) return null;
  const measures = flights.some(hasStepResponse) ? MEASURES : [];
  const several = flights.some(({ campaign_id }) => campaign_id !== first.campaign_id);
  return (
    <ScrollTable label="Flights compared" className={classes["table"]}>
      <thead>
        <tr>
          <th scope="col">Flight</th>
          <th scope="col">Error</th>
          <th scope="col">Against {first.label}</th>
          {measures.map(({ name, title, topic }) => (
            <th key={name} scope="col">
              {title} <HelpTip topic={topic} />
            </th>
          ))}
          {gains.map(({ title, unit: of }) => (
            <th key={`${title} ${of}`} scope="col">
              {title}
              {of && ` (${of})`}
            </th>
          ))}
          <th scope="col">
            <span className="visually-hidden">Actions</span>
          </th>
        </tr>
      </thead>
      <tbody>
        {flights.map((flight, index) => (
          <tr key={flight.trial_id}>
            <th scope="row">
              <Name flight={flight} several={several} pen={pens.get(flight.trial_id)} />
            </th>
            <td>
              <ErrorCell flight={flight} unit={unit} />
            </td>
            <td>
              <Against pair={againstFirst(pairs, first.trial_id, flight.trial_id)} first={first.label} unit={unit} />
            </td>
            {measures.map((measure) => (
              <td key={measure.name}>{measureText(flight, measure)}</td>
            ))}
            {gains.map((difference) => (
              <td key={`${difference.title} ${difference.unit}`}>
                <Value difference={difference} index={index} />
              </td>
            ))}
            <td>
              <span className={classes["acts"]}>
                {index > 0 && (
                  <Act title={`Use ${flight.name} as reference`} onClick={() => onFirst(flight.trial_id)}>
                    <IconArrowBarToUp size={20} color="var(--dim)" />
                  </Act>
                )}
                <Act title={`Remove ${flight.name}`} onClick={() => onRemove(flight.trial_id)}>
                  <IconX size={20} color="var(--dim)" />
                </Act>
              </span>
            </td>
          </tr>
        ))}
      </tbody>
    </ScrollTable>
  );
}

function Act({ title, onClick, children }: { title: string; onClick: () => void; children: ReactNode }) {
  return (
    <ActionIcon color="gray" aria-label={title} title={title} onClick={onClick}>
      {children}
    </ActionIcon>
  );
}

function Name({ flight, several, pen }: { flight: ComparedFlight; several: boolean; pen: LineStyle | undefined }) {
  const { label, number, campaign_id, trial_id, campaign_name, is_real, state, flown_at } = flight;
  return (
    <span className={classes["name"]}>
      <span className={classes["key"]}>
        {label}
        {pen && <LineSample pen={pen} />}
      </span>
      <span>
        <Anchor component={Link} to={`/campaigns/${campaign_id}/flights/${trial_id}`}>
          Flight {number}
        </Anchor>
        {several && <small className={`${classes["small"]} ${classes["campaignName"]}`}>{campaign_name}</small>}
        <small className={classes["small"]}>
          <VehicleBadge isReal={is_real} />
        </small>
        <small className={classes["small"]}>
          <Time at={flown_at} />
        </small>
        {state !== "valid" && <StateBadge words={trialStateLabel(state)} />}
      </span>
    </span>
  );
}

function ErrorCell({ flight: { error, group, scatter }, unit }: { flight: ComparedFlight; unit: string }) {
  if (error === null || group === null) return <>{NOTHING}</>;
  if (group.n === 1) {
    return (
      <>
        <strong>{plusMinus(error, scatter, unit)}</strong>
        {scatter !== null && <small className={classes["small"]}>± flight-to-flight scatter</small>}
      </>
    );
  }
  return (
    <>
      <strong>{plusMinus(group.mean, group.standard_error, unit)}</strong>
      <small className={classes["small"]}>
        mean of {group.n}; this flight {error.toFixed(3)} {unit}
      </small>
    </>
  );
}

const UNJUDGED = { gains: "", repeats: "Same gains", apart: "No verdict", "no error": "Not scored" } as const;

function Against({ pair, first, unit }: { pair: FlightPair | null; first: string; unit: string }) {
  if (pair === null) return <small className={classes["small"]}>reference</small>;
  const { verdict, basis, difference, standard_error, confidence, further } = pair;
  const same = basis === "repeats" && verdict !== null ? "Same gains, " : "";
  const word = verdict === null ? UNJUDGED[basis] : VERDICTS[verdict];
  return (
    <>
      <strong data-verdict={verdict ?? undefined}>{same ? same + word.toLowerCase() : word}</strong>
      {difference !== null && (
        <small className={classes["small"]}>
          {plusMinus(Math.abs(difference), standard_error, unit)} {difference < 0 ? "lower" : "higher"}
          {basis === "repeats" && ", these two flights"}
        </small>
      )}
      {confidence !== null && (
        <small className={classes["small"]}>
          {confidenceText(confidence)} confidence{verdict === null ? " of a change" : ""}
        </small>
      )}
      {further && (
        <small className={classes["small"]}>
          needs more flights:{" "}
          {sharesText([further.trial, "with its gains"], [further.against, `with those of ${first}`])}
        </small>
      )}
    </>
  );
}

/** A signed change, with the digits of a gain. */
function changeText(change: number): string {
  return change > 0 ? `+${gainText(change)}` : gainText(change);
}

interface ValueProps {
  difference: Pick<FlightDifference, "values" | "changes">;
  index: number;
}

function Value({ difference: { values, changes }, index }: ValueProps) {
  const value = values[index] ?? null;
  const change = changes[index] ?? null;
  return (
    <>
      {value === null ? NOTHING : typeof value === "number" ? gainText(value) : String(value)}
      {index > 0 && change !== null && change !== 0 && <small className={classes["small"]}>{changeText(change)}</small>}
    </>
  );
}

/** Settings that differ: a row for each setting, a column for each flight. */
export function SettingsTable({ comparison: { flights, settings } }: { comparison: FlightComparison }) {
  const everywhere = settings.filter(({ values }) => values.every((value) => value !== null));
  const somewhere = settings.filter((setting) => !everywhere.includes(setting));
  return (
    <>
      {settings.length === 0 && (
        <Note mt={10}>No other differences: same vehicle, experiment, strategy and settings.</Note>
      )}
      {everywhere.length > 0 && <Settings flights={flights} settings={everywhere} title="Settings that differ" />}
      {somewhere.length > 0 && (
        <details className={classes["words"]}>
          <summary>{count(somewhere.length, "setting")} present in only some flights</summary>
          <Settings flights={flights} settings={somewhere} title="Settings present in only some flights" />
        </details>
      )}
    </>
  );
}

interface SettingsProps {
  flights: readonly ComparedFlight[];
  settings: readonly FlightDifference[];
  title: string;
}

function Settings({ flights, settings, title }: SettingsProps) {
  return (
    <ScrollTable label={title} className={`${classes["table"]} ${classes["settings"]}`}>
      <thead>
        <tr>
          <th scope="col">{title}</th>
          {flights.map(({ trial_id, label }) => (
            <th key={trial_id} scope="col">
              {label}
            </th>
          ))}
        </tr>
      </thead>
      <tbody>
        {settings.map(({ title: name, unit, values, changes }) => (
          <tr key={`${name} ${unit}`}>
            <th scope="row">
              {name}
              {unit && ` (${unit})`}
            </th>
            {flights.map(({ trial_id }, index) => (
              <td key={trial_id}>
                <Value difference={{ values, changes }} index={index} />
              </td>
            ))}
          </tr>
        ))}
      </tbody>
    </ScrollTable>
  );
}

export interface LineStyle {
  colour: string;
  dash: string;
}

/** Plotly's dash patterns for the sample line. */
const DASHES: Readonly<Record<string, string>> = {
  dash: "7 4",
  dot: "2 3",
  dashdot: "7 3 2 3",
  longdash: "12 4",
  longdashdot: "12 3 2 3",
};

/** Line style of each flight in the figure. */
export function lineStylesOf(card: FigureCard | undefined): Map<number, LineStyle> {
  const traces = (card?.figure as unknown as PlotlyFigure | null | undefined)?.data ?? [];
  return new Map(
    traces.flatMap(({ meta, line }) =>
      meta?.role === "flight" && meta.trial !== undefined
        ? [[meta.trial, { colour: String(line?.["color"]), dash: String(line?.["dash"]) }] as const]
        : [],
    ),
  );
}

/** Sample of a flight's line in the figure. */
function LineSample({ pen }: { pen: LineStyle }) {
  return (
    <svg width="44" height="12" aria-hidden>
      <line x1="1" y1="6" x2="43" y2="6" stroke={pen.colour} strokeWidth="3" strokeDasharray={DASHES[pen.dash]} />
    </svg>
  );
}
