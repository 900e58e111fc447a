import { Button, Skeleton, useComputedColorScheme } from "@mantine/core";
import {
  type CheckFigureName,
  type ControllerCheck,
  type RecordingCheck,
  useCheck,
  useCheckFigure,
} from "../../api/checks";
import { FigurePanel } from "../../charts/FigurePanel";
import { StateBadge } from "../../ui/Badges";
import { DataTable } from "../../ui/DataTable";
import { ErrorNotice } from "../../ui/Notices";
import page from "../../ui/Page.module.css";
import { Panel } from "../../ui/Panel";
import row from "../../ui/RowCard.module.css";
import { Time } from "../../ui/Time";
import classes from "./Checks.module.css";
import { allowances, checkStateLabel, gainsText, KINDS, signalsTable } from "./checks";

const FIGURE_HEIGHT_PX = 560;
const ROW_PX = 37;

interface Props {
  checkId: number;
  upload: RecordingCheck;
  onCheck: (files: readonly File[], gains?: string) => void;
}

/** One check: its result, a table of all signals, and figures. */
export function CheckResult({ checkId, upload, onCheck }: Props) {
  const { data: check, error } = useCheck(checkId);
  if (check === undefined) {
    return error === null ? <Skeleton height={320} radius="md" aria-busy="true" /> : <ErrorNotice error={error} />;
  }
  const table = signalsTable(check.signals);
  return (
    <article className={classes["check"]} aria-label={`Check of ${check.file_name}`}>
      <Panel title={check.file_name} tools={<StateBadge words={checkStateLabel(check.passed)} />}>
        <p className={classes["sentence"]} data-passed={check.passed || undefined}>
          {check.sentence}
        </p>
        <p className={`${row["facts"]} numbers`}>
          <span>{check.autopilot}</span>
          <span>{KINDS[check.kind]}</span>
          <span>
            gains {check.gains === null ? "" : gainsText(check.gains)} {check.gains_from}
          </span>
          <span>
            checked <Time at={check.checked_at} />
          </span>
        </p>
        <DataTable table={table} label="Difference of every signal" height={ROW_PX * (table.rows.length + 1)} />
        <ul className={page["notes"]}>
          {[...allowances(check.signals), ...check.notes].map((note) => (
            <li key={note}>{note}</li>
          ))}
        </ul>
        <BetterGains check={check} upload={upload} onCheck={onCheck} />
      </Panel>
      <div className={classes["figures"]}>
        {check.figures.map(({ name, title }) => (
          <Figure key={name} checkId={checkId} name={name} title={title} />
        ))}
      </div>
    </article>
  );
}

/** Repeats the check of an uploaded file with the gains that its commands match. */
function BetterGains({ check, upload, onCheck }: Omit<Props, "checkId"> & { check: ControllerCheck }) {
  const sent = upload.data?.id === check.id ? upload.variables : undefined;
  const better = check.better_gains;
  if (sent === undefined || better === null) return null;
  return (
    <Button
      variant="default"
      mt="sm"
      loading={upload.isPending}
      onClick={() => onCheck([sent.file, ...(sent.companion ? [sent.companion] : [])], Object.values(better).join(","))}
    >
      Check again with {gainsText(better)}
    </Button>
  );
}

function Figure({ checkId, name, title }: { checkId: number; name: CheckFigureName; title: string }) {
  const theme = useComputedColorScheme("light");
  const card = useCheckFigure(checkId, name, theme);
  return <FigurePanel title={title} card={card.data} error={card.error} height={FIGURE_HEIGHT_PX} />;
}
