import { Anchor, Skeleton } from "@mantine/core";
import { IconStarFilled } from "@tabler/icons-react";
import { memo, useEffect, useRef } from "react";
import { Link } from "react-router";
import type { Campaign, Trial } from "../../api/types";
import { onPointed, pointAt } from "../../charts/pointing";
import { StateBadge } from "../../ui/Badges";
import { gainText, NOTHING, withUnit } from "../../ui/format";
import { HelpTip } from "../../ui/HelpTip";
import { Note } from "../../ui/Note";
import { Panel } from "../../ui/Panel";
import { useLastRows } from "../../ui/paging";
import { ScrollTable } from "../../ui/ScrollTable";
import { trialStateLabel, wasFlown } from "../../ui/states";
import { rangeText } from "../../ui/uncertainty";
import { useGainTitles } from "../../ui/units";
import { FlightMarkers, PredictionResult } from "./FlightMarkers";
import classes from "./FlightsPanel.module.css";
import { sentenceOf } from "./verdict";

interface Props {
  campaign: Campaign;
  /** Null while loading. */
  trials: readonly Trial[] | null;
  shown: number | null;
  unit: string;
  onChoose: (trialNumber: number) => void;
}

/** The table of all flights, with a link to compare them. */
export const FlightsPanel = memo(function FlightsPanel({ campaign, trials, shown, unit, onChoose }: Props) {
  const compare = (
    <Anchor component={Link} to={`/compare?campaign=${campaign.id}`} py={12}>
      Compare flights
    </Anchor>
  );
  return (
    <Panel title="All flights" className={classes["panel"]} tools={trials?.length ? compare : null}>
      {trials === null && <Skeleton height={320} radius="md" />}
      {trials?.length === 0 && <Note>No flights yet. Flights appear here with their gains and errors.</Note>}
      {trials !== null && trials.length > 0 && (
        <TrialsTable campaign={campaign} trials={trials} shown={shown} unit={unit} onChoose={onChoose} />
      )}
    </Panel>
  );
});

interface TrialsTableProps {
  campaign: Campaign;
  trials: readonly Trial[];
  shown: number | null;
  unit: string;
  onChoose: (trialNumber: number) => void;
}

function flightOf(target: EventTarget): number | null {
  const row = target instanceof Element ? target.closest<HTMLElement>("[data-flight]") : null;
  return row === null ? null : Number(row.dataset["flight"]);
}

/** The campaign's flights as in the paper's Table 1: gains, error, prediction, state and verdict. */
function TrialsTable({ campaign, trials, shown, unit, onChoose }: TrialsTableProps) {
  const names = Object.keys(trials[0]?.gains ?? {});
  const titles = useGainTitles(campaign.definition.experiment ?? "");
  const body = useRef<HTMLTableSectionElement>(null);
  const best = campaign.best?.trial_id;
  const isKept = ({ id, number }: Trial) => id === best || number === shown;
  const { more, listed } = useLastRows(trials, names.length + 5, "flights", isKept);
  useEffect(
    () =>
      onPointed((flight) => {
        body.current?.querySelector("[data-pointed]")?.removeAttribute("data-pointed");
        body.current?.querySelector(`[data-flight="${flight}"]`)?.setAttribute("data-pointed", "");
      }),
    [],
  );
  return (
    <ScrollTable label="All flights" className={classes["table"]}>
      <thead>
        <tr>
          <th scope="col">Flight</th>
          {names.map((name) => (
            <th key={name} scope="col">
              {name} {titles[name] && <small>{titles[name]}</small>}
            </th>
          ))}
          <th scope="col">
            Error <HelpTip topic="error" />
          </th>
          <th scope="col">
            Predicted <HelpTip topic="interval" />
          </th>
          <th scope="col" className={classes["text"]}>
            State
          </th>
          <th scope="col" className={classes["text"]}>
            Verdict
          </th>
        </tr>
      </thead>
      <tbody
        ref={body}
        onPointerOver={({ target }) => pointAt(flightOf(target))}
        onPointerLeave={() => pointAt(null)}
        onFocus={({ target }) => pointAt(flightOf(target))}
        onBlur={() => pointAt(null)}
      >
        {more}
        {listed.map((trial) => {
          const isBest = trial.id === best;
          return (
            <tr
              key={trial.id}
              data-flight={trial.number}
              data-best={isBest || undefined}
              data-shown={trial.number === shown || undefined}
            >
              <th scope="row">
                {wasFlown(trial.state) ? (
                  <button
                    type="button"
                    aria-pressed={trial.number === shown}
                    aria-label={`Flight ${trial.number}${isBest ? ", best" : ""}`}
                    onClick={() => onChoose(trial.number)}
                  >
                    {trial.number}
                    {isBest && <IconStarFilled size={15} aria-hidden />}
                  </button>
                ) : (
                  <span>{trial.number}</span>
                )}
              </th>
              {names.map((name) => (
                <td key={name} title={String(trial.gains[name] ?? "")}>
                  {gainText(trial.gains[name] ?? Number.NaN)}
                </td>
              ))}
              <td className={classes["error"]}>{withUnit(trial.error, unit)}</td>
              <td>
                <span className={classes["predicted"]}>
                  {withUnit(trial.predicted_error, unit)}
                  <PredictionResult trial={trial} brief />
                </span>
                {trial.predicted_interval && (
                  <small className={classes["range"]}>{rangeText(trial.predicted_interval, unit)}</small>
                )}
              </td>
              <td className={classes["text"]}>
                <span className={classes["state"]}>
                  <StateBadge words={trialStateLabel(trial.state)} />
                  <FlightMarkers trial={trial} />
                </span>
              </td>
              <td className={`${classes["text"]} ${classes["verdict"]}`}>{sentenceOf(trial) || NOTHING}</td>
            </tr>
          );
        })}
      </tbody>
    </ScrollTable>
  );
}
