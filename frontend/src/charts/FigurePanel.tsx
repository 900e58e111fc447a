import { ActionIcon } from "@mantine/core";
import { IconChartLine, IconTable } from "@tabler/icons-react";
import { type ReactNode, useMemo, useState } from "react";
import type { FigureCard } from "../api/types";
import { DataTable } from "../ui/DataTable";
import type { Topic } from "../ui/explanations";
import { HelpTip } from "../ui/HelpTip";
import { Note } from "../ui/Note";
import { ErrorNotice } from "../ui/Notices";
import { Panel } from "../ui/Panel";
import classes from "../ui/Panel.module.css";
import { Chart, type ChartProps } from "./Chart";
import type { PlotlyFigure } from "./traces";

interface Props extends Omit<ChartProps, "figure" | "label"> {
  title: string;
  card: FigureCard | undefined;
  error: unknown;
  /** Whether the figure has been requested. */
  wanted?: boolean;
  height: number;
  /** Modifies the received figure. */
  dressed?: (figure: PlotlyFigure) => PlotlyFigure;
  tools?: ReactNode;
  /** Help topic. */
  topic?: Topic;
  /** Text below the figure. */
  note?: string | undefined;
  className?: string | undefined;
}

/** A figure that can be switched to its data table; shows the reason if there is nothing to draw or drawing failed. */
export function FigurePanel({
  title,
  card,
  error,
  wanted = true,
  height,
  dressed,
  tools,
  topic,
  note,
  className,
  ...chart
}: Props) {
  const [asTable, setAsTable] = useState(false);
  const raw = card?.figure as PlotlyFigure | null | undefined;
  const figure = useMemo(() => (raw && dressed ? dressed(raw) : (raw ?? null)), [raw, dressed]);
  const Icon = asTable ? IconChartLine : IconTable;
  const other = asTable ? `${title}: show the chart` : `${title}: show the numbers as a table`;
  return (
    <Panel
      title={
        <>
          {title} {topic && <HelpTip topic={topic} />}
        </>
      }
      className={className}
      tools={
        <>
          {!asTable && tools}
          {card?.table && (
            <ActionIcon color="gray" aria-label={other} title={other} onClick={() => setAsTable(!asTable)}>
              <Icon size={20} color="var(--dim)" />
            </ActionIcon>
          )}
        </>
      }
    >
      {card === undefined && error !== null && <ErrorNotice error={error} />}
      {card !== undefined && card.state !== "ready" && (
        <div className={classes["waiting"]} style={{ height }}>
          {card.reason}
        </div>
      )}
      {card === undefined && error === null && <div style={{ height }} aria-busy={wanted} />}
      {figure !== null && asTable && card?.table && (
        <DataTable table={card.table} label={`${title}, numbers`} height={height} />
      )}
      {figure !== null && !asTable && (
        <Chart {...chart} figure={figure} label={`${title}. ${card?.summary ?? ""}`} height={height} />
      )}
      {note && <Note mt={10}>{note}</Note>}
    </Panel>
  );
}
