import { Anchor, Button, Checkbox, Group, Skeleton, UnstyledButton } from "@mantine/core";
import { useLocalStorage } from "@mantine/hooks";
import { IconStarFilled } from "@tabler/icons-react";
import { memo, useEffect, useMemo, useRef } from "react";
import { Link } from "wouter";
import type { Campaign, Trial } from "../../../api/types";
import { onPointed, pointAt } from "../../../charts/pointing";
import form from "../../../ui/Form.module.css";
import { count } from "../../../ui/format";
import { type Column, ListTable } from "../../../ui/ListTable";
import { Note } from "../../../ui/Note";
import { Panel } from "../../../ui/Panel";
import { wasFlown } from "../../../ui/states";
import { toggled } from "../../../ui/toggled";
import { useGainTitles } from "../../../ui/units";
import classes from "./FlightsPanel.module.css";
import { type FlightColumn, flightColumns } from "./flightColumns";
import { comparisonAddress, type SelectedFlights } from "./useSelectedFlights";

interface TableProps extends SelectedFlights {
  campaign: Campaign;
  trials: readonly Trial[];
  shown: number | null;
  unit: string;
  onChoose: (trialNumber: number) => void;
}

/** The table of all flights, null while they load: columns to choose, sorted by any of them, and rows to compare. */
export const FlightsPanel = memo(function FlightsPanel({
  trials,
  ...props
}: Omit<TableProps, "trials"> & { trials: readonly Trial[] | null }) {
  return (
    <Panel title="All flights" tools={trials?.length ? <CompareLink {...props} /> : null}>
      {trials === null && <Skeleton height={320} radius="md" />}
      {trials?.length === 0 && <Note>No flights yet. Flights appear here with their gains and errors.</Note>}
      {trials !== null && trials.length > 0 && <TrialsTable trials={trials} {...props} />}
    </Panel>
  );
});

function CompareLink({ campaign, selected }: Pick<TableProps, "campaign" | "selected">) {
  const address = comparisonAddress(campaign.id, selected);
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

function TrialsTable({ campaign, trials, shown, unit, onChoose, selected, onSelect }: TableProps) {
  const titles = useGainTitles(campaign.definition.experiment);
  const columns = useMemo(() => flightColumns(trials, titles, unit), [trials, titles, unit]);
  /** Columns that this browser shows other than by default: extra ones shown, others hidden. */
  const [changed, setChanged] = useLocalStorage<string[]>({
    key: "gainline-run-columns",
    defaultValue: [],
    getInitialValueInEffect: false,
  });
  const isVisible = ({ id, extra = false }: FlightColumn) => extra === changed.includes(id);
  const best = campaign.best?.trial_id;
  const table = useRef<HTMLElement>(null);
  useEffect(
    () =>
      onPointed((flight) => {
        table.current?.querySelector("[data-pointed]")?.removeAttribute("data-pointed");
        table.current?.querySelector(`[data-flight="${flight}"]`)?.setAttribute("data-pointed", "");
      }),
    [],
  );
  const leading: Column<Trial>[] = [
    {
      title: "Selected",
      hidesTitle: true,
      className: classes["pick"],
      cell: ({ id, number, state }) =>
        wasFlown(state) && (
          <label className={form["tick"]}>
            <input
              type="checkbox"
              aria-label={`Select flight ${number}`}
              checked={selected.includes(id)}
              onChange={() => onSelect(id)}
            />
          </label>
        ),
    },
    {
      title: "Flight",
      isHeading: true,
      isText: true,
      className: classes["number"],
      cell: ({ id, number, state }) =>
        wasFlown(state) ? (
          <UnstyledButton
            aria-pressed={number === shown}
            aria-label={`Flight ${number}${id === best ? ", best" : ""}`}
            onClick={() => onChoose(number)}
          >
            {number}
            {id === best && <IconStarFilled size={15} aria-hidden />}
          </UnstyledButton>
        ) : (
          <b>{number}</b>
        ),
    },
  ];
  return (
    <>
      <details>
        <summary>Columns</summary>
        <Group gap="4px 20px" py={8}>
          {columns.map((column) => (
            <Checkbox
              key={column.id}
              label={column.title}
              checked={isVisible(column)}
              onChange={() => setChanged(toggled(changed, column.id))}
            />
          ))}
        </Group>
      </details>
      <ListTable
        label="All flights"
        framed
        className={classes["table"]}
        columns={[...leading, ...columns.filter(isVisible)]}
        rows={trials}
        keyOf={({ id }) => String(id)}
        what="flights"
        isKept={({ id, number }) => id === best || number === shown}
        marks={({ id, number }) => ({
          "data-flight": number,
          "data-best": id === best || undefined,
          "data-shown": number === shown || undefined,
        })}
        ref={table}
        onPointerOver={({ target }) => pointAt(flightOf(target))}
        onPointerLeave={() => pointAt(null)}
        onFocus={({ target }) => pointAt(flightOf(target))}
        onBlur={() => pointAt(null)}
      />
    </>
  );
}
