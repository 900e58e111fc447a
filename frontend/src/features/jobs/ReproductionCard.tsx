import { Box, Button, SimpleGrid, Text } from "@mantine/core";
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
import { type Column, ListTable } from "../../ui/ListTable";
import { Note } from "../../ui/Note";
import { ErrorNotice } from "../../ui/Notices";
import page from "../../ui/Page.module.css";
import { Panel } from "../../ui/Panel";
import { Time } from "../../ui/Time";
import { JobProgress } from "./JobTable";
import { comparedColumns, duration, isUnderWay, measure, ratioSpan } from "./jobs";
import classes from "./ReproductionCard.module.css";

const FIGURE_HEIGHT_PX = 360;
const PROSE = { maw: "90ch", lh: 1.45, mb: 8 };

/** One experiment of the paper: published and own results, and figures. */
export function ReproductionCard({ reproduction }: { reproduction: ReproductionSummary }) {
  const { name, title, line, paper, figures, latest } = reproduction;
  const result = useReproductionResult(name, latest?.job_id ?? null);
  const span = result.data ? ratioSpan(result.data.rows) : null;
  return (
    <Box component="article" id={name} display="grid" miw={0} style={{ gap: "var(--gap)" }} aria-label={title}>
      <Panel title={title} tools={<Actions reproduction={reproduction} />}>
        <Text {...PROSE}>
          <strong>In the paper:</strong> {paper}
        </Text>
        <Text {...PROSE}>
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
        <SimpleGrid minColWidth="min(420px, 100%)" autoFlow="auto-fit" spacing="var(--gap)">
          {figures.map((figure) => (
            <Figure key={figure.name} name={name} figure={figure.name} title={figure.title} jobId={latest.job_id} />
          ))}
        </SimpleGrid>
      )}
    </Box>
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
      {job?.state === "cancelled" && <Text {...PROSE}>The last run was cancelled.</Text>}
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
  const card = useReproductionFigure(name, figure, jobId);
  return (
    <FigurePanel title={card.data?.title ?? title} card={card.data} error={card.error} height={FIGURE_HEIGHT_PX} />
  );
}

const RATIO_DIGITS = 3;

/** Own and published numbers, grouped. */
function ReproductionRows({ rows, title }: { rows: readonly ReproductionRow[]; title: string }) {
  const columns: Column<ReproductionRow>[] = [
    {
      title: "Quantity",
      hidesTitle: true,
      isHeading: true,
      cell: ({ label, note, overruled }) => (
        <>
          {label}{" "}
          <Note span fz="fine">
            {note}
          </Note>{" "}
          {overruled !== "" && (
            <Note span fz="fine" title={overruled}>
              refused by the gate, overruled
            </Note>
          )}
        </>
      ),
    },
    {
      title: "Gainline",
      cell: ({ measured, digits, unit }) => (
        <>
          <strong>{measure(measured, digits)}</strong>{" "}
          <Note span inherit>
            {unit}
          </Note>
        </>
      ),
    },
    ...comparedColumns(rows).map(([key, heading]) => ({
      title: heading,
      cell: (row: ReproductionRow) => measure(row[key], key === "ratio" ? RATIO_DIGITS : row.digits),
    })),
  ];
  return (
    <ListTable
      label={`${title}: numbers`}
      className={classes["table"]}
      columns={columns}
      rows={rows}
      keyOf={({ group, label }) => `${group} ${label}`}
      groupOf={({ group }) => group}
    />
  );
}
