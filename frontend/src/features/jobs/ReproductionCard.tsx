import { Button, Text, useComputedColorScheme } from "@mantine/core";
import { IconPlayerPlay, IconX } from "@tabler/icons-react";
import {
  type ReproductionRow,
  type ReproductionSummary,
  useCancelJob,
  useReproductionFigure,
  useReproductionResult,
  useRunReproduction,
} from "../../api/jobs";
import { FigurePanel } from "../../charts/FigurePanel";
import { Aside } from "../../ui/Aside";
import { Note } from "../../ui/Note";
import { ErrorNotice } from "../../ui/Notices";
import page from "../../ui/Page.module.css";
import { Panel } from "../../ui/Panel";
import { ScrollTable } from "../../ui/ScrollTable";
import { Time } from "../../ui/Time";
import { JobProgress } from "./JobTable";
import { type ComparedColumn, comparedColumns, duration, grouped, isUnderWay, measure, ratioSpan } from "./jobs";
import classes from "./ReproductionCard.module.css";

const FIGURE_HEIGHT_PX = 360;

/** One experiment of the paper: published and own results, and figures. */
export function ReproductionCard({ reproduction }: { reproduction: ReproductionSummary }) {
  const { name, title, line, paper, figures, latest } = reproduction;
  const result = useReproductionResult(name, latest?.job_id ?? null);
  const span = result.data ? ratioSpan(result.data.rows) : null;
  return (
    <article id={name} className={classes["card"]} aria-label={title}>
      <Panel title={title} tools={<Actions reproduction={reproduction} />}>
        <Text maw="90ch" lh={1.45} mb={8}>
          <strong>In the paper:</strong> {paper}
        </Text>
        <Text maw="90ch" lh={1.45} mb={8}>
          <strong>In Gainline:</strong> {line}
          {span !== null && <> Results: {span}.</>}
        </Text>
        <Standing reproduction={reproduction} />
        <ErrorNotice error={result.error} />
        {result.data && result.data.rows.length > 0 && (
          <>
            <ReproductionRows rows={result.data.rows} title={title} />
            <ul className={page["notes"]}>
              {result.data.notes.map((note) => (
                <li key={note}>{note}</li>
              ))}
            </ul>
          </>
        )}
      </Panel>
      {latest !== null && (
        <div className={classes["figures"]}>
          {figures.map((figure) => (
            <Figure key={figure.name} name={name} figure={figure.name} title={figure.title} jobId={latest.job_id} />
          ))}
        </div>
      )}
    </article>
  );
}

function Actions({ reproduction: { name, title, job, latest, long_form } }: { reproduction: ReproductionSummary }) {
  const run = useRunReproduction();
  const cancel = useCancelJob();
  if (job !== null && isUnderWay(job)) {
    return (
      <Button
        variant="default"
        leftSection={<IconX size={18} aria-hidden />}
        aria-label={`Cancel: ${title}`}
        loading={cancel.isPending}
        onClick={() => cancel.mutate(job.id)}
      >
        Cancel
      </Button>
    );
  }
  return (
    <>
      {long_form !== "" && (
        <Button
          variant="default"
          title={long_form}
          aria-label={`Full run: ${title}`}
          onClick={() => run.mutate({ name, full: true })}
        >
          Full run
        </Button>
      )}
      <Button
        variant={latest === null ? "filled" : "default"}
        leftSection={<IconPlayerPlay size={18} aria-hidden />}
        aria-label={`Run: ${title}`}
        loading={run.isPending}
        onClick={() => run.mutate({ name })}
      >
        {latest === null ? "Run" : "Run again"}
      </Button>
    </>
  );
}

/** Progress of the current run or the failure of the last one, and the time of the shown result. */
function Standing({ reproduction: { title, job, latest } }: { reproduction: ReproductionSummary }) {
  return (
    <>
      {job !== null && isUnderWay(job) && <JobProgress job={job} title={`Progress: ${title}`} />}
      {job?.state === "cancelled" && (
        <Text maw="90ch" lh={1.45} mb={8}>
          The last run was cancelled.
        </Text>
      )}
      {job?.problem && (
        <Aside tone="bad" fz="body" role="alert">
          <strong>The last run failed: {job.problem.title}</strong>
          {job.problem.detail && <p>{job.problem.detail}</p>}
          <p>{job.problem.hint}</p>
        </Aside>
      )}
      <Note fz="small" my={10}>
        {latest === null ? (
          "Not run yet."
        ) : (
          <>
            Last run <Time at={latest.finished_at} />
            {latest.full && " (full)"}, took {duration(latest.seconds)}.
          </>
        )}
      </Note>
    </>
  );
}

interface FigureProps {
  name: string;
  figure: string;
  title: string;
  jobId: number;
}

function Figure({ name, figure, title, jobId }: FigureProps) {
  const theme = useComputedColorScheme("light");
  const card = useReproductionFigure(name, figure, theme, jobId);
  return (
    <FigurePanel title={card.data?.title ?? title} card={card.data} error={card.error} height={FIGURE_HEIGHT_PX} />
  );
}

const RATIO_DIGITS = 3;

/** Own and published numbers, grouped. */
function ReproductionRows({ rows, title }: { rows: readonly ReproductionRow[]; title: string }) {
  const columns = comparedColumns(rows);
  return (
    <ScrollTable label={`${title}: numbers`} className={classes["table"]}>
      <thead>
        <tr>
          <td />
          <th scope="col">Gainline</th>
          {columns.map(([key, heading]) => (
            <th key={key} scope="col">
              {heading}
            </th>
          ))}
        </tr>
      </thead>
      {grouped(rows).map((group) => (
        <tbody key={group.title}>
          <tr className={classes["group"]}>
            <th scope="rowgroup" colSpan={2 + columns.length}>
              {group.title}
            </th>
          </tr>
          {group.rows.map((row) => (
            <Row key={row.label} row={row} columns={columns} />
          ))}
        </tbody>
      ))}
    </ScrollTable>
  );
}

function Row({ row, columns }: { row: ReproductionRow; columns: readonly ComparedColumn[] }) {
  return (
    <tr>
      <th scope="row">
        {row.label} {row.note !== "" && <span className={classes["note"]}>{row.note}</span>}{" "}
        {row.overruled !== "" && (
          <span className={classes["note"]} title={row.overruled}>
            refused by the gate, overruled
          </span>
        )}
      </th>
      <td className={classes["ours"]}>
        {measure(row.measured, row.digits)} <span className={classes["unit"]}>{row.unit}</span>
      </td>
      {columns.map(([key]) => (
        <td key={key}>{measure(row[key], key === "ratio" ? RATIO_DIGITS : row.digits)}</td>
      ))}
    </tr>
  );
}
