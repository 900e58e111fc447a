import { ActionIcon, Anchor, Box, Group } from "@mantine/core";
import { IconArrowBarToUp, IconX } from "@tabler/icons-react";
import type { ReactNode } from "react";
import { Link } from "wouter";
import type { ComparedFlight, FlightComparison, FlightDifference, FlightPair } from "../../api/compare";
import type { FigureCard } from "../../api/types";
import type { PlotlyFigure } from "../../charts/traces";
import { StateBadge, VehicleBadge } from "../../ui/Badges";
import { count, gainText, NOTHING, sharesText } from "../../ui/format";
import { type Column, ListTable } from "../../ui/ListTable";
import { Note } from "../../ui/Note";
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
  const several = flights.some(({ campaign_id }) => campaign_id !== first.campaign_id);
  const columns: Column<ComparedFlight>[] = [
    {
      title: "Flight",
      isHeading: true,
      cell: (flight) => <Name flight={flight} several={several} pen={pens.get(flight.trial_id)} />,
    },
    { title: "Error", cell: (flight) => <ErrorCell flight={flight} unit={unit} /> },
    {
      title: `Against ${first.label}`,
      cell: ({ trial_id }) => (
        <Against pair={againstFirst(pairs, first.trial_id, trial_id)} first={first.label} unit={unit} />
      ),
    },
    ...(flights.some(hasStepResponse) ? MEASURES : []).map((measure) => ({
      title: measure.title,
      topic: measure.topic,
      cell: (flight: ComparedFlight) => measureText(flight, measure),
    })),
    ...gains.map((difference) => ({
      title: settingTitle(difference),
      cell: (flight: ComparedFlight) => <Value difference={difference} index={flights.indexOf(flight)} />,
    })),
    {
      title: "Actions",
      hidesTitle: true,
      cell: (flight) => (
        <>
          {flight !== first && (
            <Act title={`Use ${flight.name} as reference`} onClick={() => onFirst(flight.trial_id)}>
              <IconArrowBarToUp size={20} color="var(--dim)" />
            </Act>
          )}
          <Act title={`Remove ${flight.name}`} onClick={() => onRemove(flight.trial_id)}>
            <IconX size={20} color="var(--dim)" />
          </Act>
        </>
      ),
    },
  ];
  return (
    <ListTable label="Flights compared" columns={columns} rows={flights} keyOf={({ trial_id }) => String(trial_id)} />
  );
}

const settingTitle = ({ title, unit }: FlightDifference): string => (unit ? `${title} (${unit})` : title);

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
    <Group gap={8} wrap="nowrap" align="start">
      {label}
      {pen && <LineSample pen={pen} />}
      <span>
        <Anchor component={Link} to={`/campaigns/${campaign_id}/flights/${trial_id}`}>
          Flight {number}
        </Anchor>
        {several && (
          <Box component="small" maw={170} style={{ whiteSpace: "normal" }}>
            {campaign_name}
          </Box>
        )}
        <small>
          <VehicleBadge isReal={is_real} />
        </small>
        <small>
          <Time at={flown_at} />
        </small>
        {state !== "valid" && <StateBadge words={trialStateLabel(state)} />}
      </span>
    </Group>
  );
}

function ErrorCell({ flight: { error, group, scatter }, unit }: { flight: ComparedFlight; unit: string }) {
  if (error === null || group === null) return NOTHING;
  const remark =
    group.n === 1
      ? scatter !== null && "± flight-to-flight scatter"
      : `mean of ${group.n}; this flight ${error.toFixed(3)} ${unit}`;
  return (
    <>
      <strong>
        {group.n === 1 ? plusMinus(error, scatter, unit) : plusMinus(group.mean, group.standard_error, unit)}
      </strong>
      {remark && <small>{remark}</small>}
    </>
  );
}

const UNJUDGED = { gains: "", repeats: "Same gains", apart: "No verdict", "no error": "Not scored" } as const;

const COLOURS = { better: "var(--best)", worse: "var(--bad)", unresolved: "", "not known yet": "" } as const;

function Against({ pair, first, unit }: { pair: FlightPair | null; first: string; unit: string }) {
  if (pair === null) return <small>reference</small>;
  const { verdict, basis, difference, standard_error, confidence, further } = pair;
  const same = basis === "repeats" && verdict !== null ? "Same gains, " : "";
  const word = verdict === null ? UNJUDGED[basis] : VERDICTS[verdict].word;
  return (
    <>
      <strong style={{ color: verdict === null ? undefined : COLOURS[verdict] }}>
        {same ? same + word.toLowerCase() : word}
      </strong>
      {difference !== null && (
        <small>
          {plusMinus(Math.abs(difference), standard_error, unit)} {difference < 0 ? "lower" : "higher"}
          {basis === "repeats" && ", these two flights"}
        </small>
      )}
      {confidence !== null && (
        <small>
          {confidenceText(confidence)} confidence{verdict === null ? " of a change" : ""}
        </small>
      )}
      {further && (
        <small>
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

function Value({ difference: { values, changes }, index }: { difference: FlightDifference; index: number }) {
  const value = values[index] ?? null;
  const change = changes[index] ?? null;
  return (
    <>
      {value === null ? NOTHING : typeof value === "number" ? gainText(value) : String(value)}
      {index > 0 && change !== null && change !== 0 && <small>{changeText(change)}</small>}
    </>
  );
}

/** Settings that differ: a row for each setting, a column for each flight. */
export function SettingsTable({ comparison: { flights, settings } }: { comparison: FlightComparison }) {
  const isEverywhere = ({ values }: FlightDifference) => !values.includes(null);
  const everywhere = settings.filter(isEverywhere);
  const somewhere = settings.filter((setting) => !isEverywhere(setting));
  return (
    <>
      {settings.length === 0 && (
        <Note mt={10}>No other differences: same vehicle, experiment, strategy and settings.</Note>
      )}
      {everywhere.length > 0 && <Settings flights={flights} settings={everywhere} title="Settings that differ" />}
      {somewhere.length > 0 && (
        <details>
          <Box component="summary" fz="body">
            {count(somewhere.length, "setting")} present in only some flights
          </Box>
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
  const columns: Column<FlightDifference>[] = [
    { title, isHeading: true, cell: settingTitle },
    ...flights.map(({ label }, index) => ({
      title: label,
      cell: (setting: FlightDifference) => <Value difference={setting} index={index} />,
    })),
  ];
  return (
    <ListTable label={title} className={classes["settings"]} columns={columns} rows={settings} keyOf={settingTitle} />
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
    <svg width="44" height="22" viewBox="0 -5 44 22" aria-hidden>
      <line x1="1" y1="6" x2="43" y2="6" stroke={pen.colour} strokeWidth="3" strokeDasharray={DASHES[pen.dash]} />
    </svg>
  );
}
