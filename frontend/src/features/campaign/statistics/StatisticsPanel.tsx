import { Stack } from "@mantine/core";
import { IconAlertTriangle } from "@tabler/icons-react";
import { useStatistics } from "../../../api/queries";
import type { CampaignStatistics, RepeatGroup } from "../../../api/types";
import { Aside, toneOf } from "../../../ui/Aside";
import { count, flightNumbers, sharesText } from "../../../ui/format";
import { gainsInBrackets } from "../../../ui/gains";
import { HelpTip } from "../../../ui/HelpTip";
import { type Column, ListTable } from "../../../ui/ListTable";
import { Note } from "../../../ui/Note";
import { ErrorNotice } from "../../../ui/Notices";
import { Panel } from "../../../ui/Panel";
import { confidenceText, plusMinus } from "../../../ui/uncertainty";
import { VERDICTS } from "../verdict/verdict";
import classes from "./StatisticsPanel.module.css";

/** Statistics of the flights: verdict, scatter, predictions. */
export function StatisticsPanel({ campaignId }: { campaignId: number }) {
  const statistics = useStatistics(campaignId);
  return (
    <Panel title="Statistics">
      <ErrorNotice error={statistics.error} />
      {statistics.isPending && <div style={{ minHeight: 160 }} aria-busy="true" />}
      {statistics.data && statistics.data.groups.length === 0 && (
        <Note>
          Available after the first valid flight: the scatter of the error, whether the best gains are better, and how
          good the predictions are.
        </Note>
      )}
      {statistics.data && statistics.data.groups.length > 0 && <Results {...statistics.data} />}
    </Panel>
  );
}

function Results(all: CampaignStatistics) {
  const { comparison, drift, track_record: record, notes, battery_trend: trend } = all;
  const shown = [comparison, drift, record, trend].map((one) => one?.sentence ?? "");
  return (
    <div className={classes["results"]}>
      <div className={classes["facts"]}>
        <Verdict comparison={comparison} unit={all.error_unit} />
        <Scatter {...all} />
        <Predictions record={record} />
      </div>
      <Stack gap={14}>
        <Groups {...all} />
        <ul className={classes["notes"]}>
          {drift && (
            <li>
              {drift.sentence} <HelpTip topic="drift" />
            </li>
          )}
          {trend && <li>{trend.sentence}</li>}
          {notes
            .filter((note) => !shown.includes(note))
            .map((note) => (
              <li key={note}>{note}</li>
            ))}
        </ul>
      </Stack>
    </div>
  );
}

function Verdict({ comparison, unit }: { comparison: CampaignStatistics["comparison"]; unit: string }) {
  if (comparison === null) {
    return (
      <Aside className={classes["fact"] ?? ""}>
        <h3>Best vs. baseline</h3>
        <p className={classes["big"]}>Same gains</p>
        <p>Nothing to compare: the first flight's gains are the best so far.</p>
      </Aside>
    );
  }
  const { verdict, confidence, difference, standard_error, further } = comparison;
  const more = further === null ? null : further.best + further.baseline;
  return (
    <Aside tone={toneOf(verdict)} className={classes["fact"] ?? ""}>
      <h3>
        Best vs. baseline
        <HelpTip topic="difference" />
      </h3>
      <p className={classes["big"]}>
        {VERDICTS[verdict]}
        {confidence !== null && <small>{confidenceText(confidence)} confidence</small>}
      </p>
      <p className="numbers">
        <span className="quantity">{plusMinus(Math.abs(difference), standard_error, unit)}</span>{" "}
        {difference < 0 ? "lower" : "higher"}
        {verdict === "not known yet" && <strong className={classes["more"]}>Fly one of the two gain sets again</strong>}
        {verdict === "unresolved" && more !== null && (
          <strong className={classes["more"]}>
            {count(more, "more flight")} needed:{" "}
            {sharesText([further?.best ?? 0, "with the best gains"], [further?.baseline ?? 0, "with the first"])}
          </strong>
        )}
      </p>
    </Aside>
  );
}

function Scatter({ sigma, degrees_of_freedom: freedom, scatter_source: source, error_unit: unit }: CampaignStatistics) {
  return (
    <Aside className={classes["fact"] ?? ""}>
      <h3>
        Flight-to-flight scatter
        <HelpTip topic="scatter" />
      </h3>
      {!sigma ? (
        <p className={classes["big"]}>{sigma === 0 ? "None" : "Not known yet"}</p>
      ) : (
        <p className={`${classes["big"]} numbers`}>
          {plusMinus(sigma, sigma / Math.sqrt(2 * freedom), unit)}
          <small>± standard error</small>
        </p>
      )}
      <p>{source}</p>
    </Aside>
  );
}

/** What the record says besides the intervals. */
function directionText({ of, agreeing, disagreeing, sentence }: CampaignStatistics["track_record"]): string {
  const changed = agreeing + disagreeing;
  if (of === 0) return sentence;
  return changed === 0
    ? ""
    : `${agreeing} of ${count(changed, "flight")} with new gains changed the error in the predicted direction. Repeats are not counted: they predict no change.`;
}

function Predictions({ record }: { record: CampaignStatistics["track_record"] }) {
  return (
    <Aside tone={record.trustworthy ? undefined : "bad"} className={classes["fact"] ?? ""}>
      <h3>
        Predictions inside their interval
        <HelpTip topic="record" />
      </h3>
      <p className={`${classes["big"]} numbers`}>
        {record.of === 0 ? "None yet" : `${record.inside} of ${record.of}`}
        {record.of > 0 && <small>90&nbsp;% expected</small>}
      </p>
      {!record.trustworthy && (
        <p className={classes["warning"]}>
          <IconAlertTriangle size={18} aria-hidden /> Gradient unreliable
        </p>
      )}
      <p className={classes["fine"]}>{directionText(record)}</p>
    </Aside>
  );
}

/** One row for each gain set. */
function Groups({ groups, error_unit: unit }: CampaignStatistics) {
  const columns: Column<RepeatGroup>[] = [
    {
      title: `[${Object.keys(groups[0]?.gains ?? {}).join(" ")}]`,
      isHeading: true,
      cell: ({ gains }) => gainsInBrackets(gains),
    },
    { title: "Flight no.", cell: ({ trial_numbers }) => flightNumbers(trial_numbers) },
    {
      title: "Mean error ± standard error",
      topic: "standardError",
      cell: ({ mean, standard_error }) => plusMinus(mean, standard_error, unit),
    },
    {
      title: "Role",
      cell: ({ is_best, is_baseline }) =>
        [is_best ? "best" : "", is_baseline ? "baseline" : ""].filter(Boolean).join(", "),
    },
  ];
  return (
    <ListTable
      label="Gain sets flown"
      framed
      className={classes["groups"]}
      columns={columns}
      rows={groups}
      keyOf={({ trial_numbers: [first] }) => String(first)}
      what="gain sets"
      isKept={({ is_best, is_baseline, trial_numbers }) => is_best || is_baseline || trial_numbers.length > 1}
      marks={({ is_best }) => ({ "data-best": is_best || undefined })}
    />
  );
}
