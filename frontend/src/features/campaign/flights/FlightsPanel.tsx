import { Anchor, Button, Checkbox, Group, Skeleton } from "@mantine/core";
import { useLocalStorage } from "@mantine/hooks";
import { IconArrowDown, IconArrowUp, IconStarFilled } from "@tabler/icons-react";
import { memo, useEffect, useMemo, useRef, useState } from "react";
import { Link } from "react-router";
import type { Campaign, Trial } from "../../../api/types";
import { onPointed, pointAt } from "../../../charts/pointing";
import { count } from "../../../ui/format";
import { HelpTip } from "../../../ui/HelpTip";
import { Note } from "../../../ui/Note";
import { Panel } from "../../../ui/Panel";
import { useLastRows } from "../../../ui/paging";
import { ScrollTable } from "../../../ui/ScrollTable";
import { wasFlown } from "../../../ui/states";
import { useGainTitles } from "../../../ui/units";
import classes from "./FlightsPanel.module.css";
import { type FlightColumn, flightColumns } from "./flightColumns";
import { nextOrder, type Order, sortedBy, toggled } from "./flightsTable";
import { comparisonAddress, type SelectedFlights } from "./useSelectedFlights";

interface Props extends SelectedFlights {
  campaign: Campaign;
  /** Null while loading. */
  trials: readonly Trial[] | null;
  shown: number | null;
  unit: string;
  onChoose: (trialNumber: number) => void;
}

const NO_TITLES: Readonly<Record<string, string>> = {};

/** The table of all flights: columns to choose, sorted by any of them, and rows to compare. */
export const FlightsPanel = memo(function FlightsPanel({ trials, ...props }: Props) {
  const { campaign, selected } = props;
  return (
    <Panel
      title="All flights"
      className={classes["panel"]}
      tools={trials?.length ? <CompareLink campaign={campaign.id} selected={selected} /> : null}
    >
      {trials === null && <Skeleton height={320} radius="md" />}
      {trials?.length === 0 && <Note>No flights yet. Flights appear here with their gains and errors.</Note>}
      {trials !== null && trials.length > 0 && <TrialsTable trials={trials} {...props} />}
    </Panel>
  );
});

function CompareLink({ campaign, selected }: { campaign: number; selected: readonly number[] }) {
  const address = comparisonAddress(campaign, selected);
  if (selected.length < 2) {
    return (
      <Anchor component={Link} to={address} py={12}>
        Compare flights
      </Anchor>
    );
  }
  return (
    <Button component={Link} to={address} variant="default">
      Compare {count(selected.length, "selected flight")}
    </Button>
  );
}

function flightOf(target: EventTarget): number | null {
  const row = target instanceof Element ? target.closest<HTMLElement>("[data-flight]") : null;
  return row === null ? null : Number(row.dataset["flight"]);
}

/** Columns that this browser shows other than by default: extra ones shown, others hidden. */
function useChosenColumns(columns: readonly FlightColumn[]) {
  const [changed, setChanged] = useLocalStorage<string[]>({
    key: "gainline-run-columns",
    defaultValue: [],
    getInitialValueInEffect: false,
  });
  const isShown = ({ id, extra = false }: FlightColumn) => extra === changed.includes(id);
  return { visible: columns.filter(isShown), isShown, toggle: (id: string) => setChanged(toggled(changed, id)) };
}

interface TrialsTableProps extends Props {
  trials: readonly Trial[];
}

function TrialsTable({ campaign, trials, shown, unit, onChoose, selected, onSelect }: TrialsTableProps) {
  const titles = useGainTitles(campaign.definition.experiment ?? "") ?? NO_TITLES;
  const columns = useMemo(() => flightColumns(trials, titles, unit), [trials, titles, unit]);
  const { visible, isShown, toggle } = useChosenColumns(columns);
  const [order, setOrder] = useState<Order | null>(null);
  const by = visible.find(({ id }) => id === order?.column);
  const rows = useMemo(
    () => (by && order ? [...sortedBy(trials, by.value, order.descending)].reverse() : trials),
    [trials, by, order],
  );
  const body = useRef<HTMLTableSectionElement>(null);
  const best = campaign.best?.trial_id;
  const isKept = ({ id, number }: Trial) => id === best || number === shown;
  const last = useLastRows(rows, visible.length + 2, "flights", isKept, by ? "further" : "earlier");
  const listed = by ? [...last.listed].reverse() : last.listed;
  useEffect(
    () =>
      onPointed((flight) => {
        body.current?.querySelector("[data-pointed]")?.removeAttribute("data-pointed");
        body.current?.querySelector(`[data-flight="${flight}"]`)?.setAttribute("data-pointed", "");
      }),
    [],
  );
  return (
    <>
      <details className={classes["columns"]}>
        <summary>Columns</summary>
        <Group gap="4px 20px" py={8}>
          {columns.map((column) => (
            <Checkbox
              key={column.id}
              label={column.title}
              checked={isShown(column)}
              onChange={() => toggle(column.id)}
            />
          ))}
        </Group>
      </details>
      <ScrollTable label="All flights" framed className={classes["table"]}>
        <thead>
          <tr>
            <th>
              <span className="visually-hidden">Selected</span>
            </th>
            <th scope="col">Flight</th>
            {visible.map((column) => (
              <Heading key={column.id} column={column} order={order} onSort={setOrder} />
            ))}
          </tr>
        </thead>
        <tbody
          ref={body}
          onPointerOver={({ target }) => pointAt(flightOf(target))}
          onPointerLeave={() => pointAt(null)}
          onFocus={({ target }) => pointAt(flightOf(target))}
          onBlur={() => pointAt(null)}
        >
          {!by && last.more}
          {listed.map((trial) => (
            <FlightRow
              key={trial.id}
              trial={trial}
              columns={visible}
              isBest={trial.id === best}
              isShown={trial.number === shown}
              isSelected={selected.includes(trial.id)}
              onChoose={onChoose}
              onSelect={onSelect}
            />
          ))}
          {by && last.more}
        </tbody>
      </ScrollTable>
    </>
  );
}

interface HeadingProps {
  column: FlightColumn;
  order: Order | null;
  onSort: (order: Order | null) => void;
}

function Heading({ column: { id, title, detail, topic, className }, order, onSort }: HeadingProps) {
  const own = order?.column === id ? order : null;
  const Icon = own?.descending ? IconArrowDown : IconArrowUp;
  return (
    <th
      scope="col"
      className={className}
      aria-sort={own === null ? undefined : own.descending ? "descending" : "ascending"}
    >
      <span className={classes["heading"]}>
        <button type="button" title={`Sort by ${title}`} onClick={() => onSort(nextOrder(order, id))}>
          {title}
          {own && <Icon size={15} aria-hidden />}
        </button>
        {topic && <HelpTip topic={topic} />}
      </span>
      {detail && <small>{detail}</small>}
    </th>
  );
}

interface FlightRowProps {
  trial: Trial;
  columns: readonly FlightColumn[];
  isBest: boolean;
  isShown: boolean;
  isSelected: boolean;
  onChoose: (trialNumber: number) => void;
  onSelect: (trialId: number) => void;
}

function FlightRow({ trial, columns, isBest, isShown, isSelected, onChoose, onSelect }: FlightRowProps) {
  const { id, number, state } = trial;
  return (
    <tr data-flight={number} data-best={isBest || undefined} data-shown={isShown || undefined}>
      <td className={classes["pick"]}>
        {wasFlown(state) && (
          <label>
            <input
              type="checkbox"
              aria-label={`Select flight ${number}`}
              checked={isSelected}
              onChange={() => onSelect(id)}
            />
          </label>
        )}
      </td>
      <th scope="row">
        {wasFlown(state) ? (
          <button
            type="button"
            aria-pressed={isShown}
            aria-label={`Flight ${number}${isBest ? ", best" : ""}`}
            onClick={() => onChoose(number)}
          >
            {number}
            {isBest && <IconStarFilled size={15} aria-hidden />}
          </button>
        ) : (
          <span>{number}</span>
        )}
      </th>
      {columns.map((column) => (
        <td key={column.id} className={column.className}>
          {column.cell(trial)}
        </td>
      ))}
    </tr>
  );
}
