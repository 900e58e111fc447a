import { Box, Button, Group, Stack, Text, Title } from "@mantine/core";
import { useMutation } from "@tanstack/react-query";
import { useEffect, useMemo, useState } from "react";
import { useSearchParams } from "wouter";
import {
  comparisonFigure,
  curvesCsv,
  type FlightComparison,
  paramsOf,
  useComparison,
  useComparisonFigure,
} from "../../api/compare";
import { problemOf } from "../../api/problems";
import { useTrial } from "../../api/queries";
import { FigurePanel } from "../../charts/FigurePanel";
import { loadPlotly } from "../../charts/plotly";
import type { PlotlyFigure } from "../../charts/traces";
import { Aside, toneOf } from "../../ui/Aside";
import { count } from "../../ui/format";
import { Note } from "../../ui/Note";
import { ErrorNotice, FailureNotice } from "../../ui/Notices";
import work from "../../ui/Page.module.css";
import { Panel } from "../../ui/Panel";
import { toggled } from "../../ui/toggled";
import { useTitle } from "../../ui/useTitle";
import { VERDICTS } from "../campaign/verdict/verdict";
import { ComparisonTable, lineStylesOf, SettingsTable } from "./ComparisonTable";
import { againstFirst, chosenIn, remember, remembered, withoutRefused } from "./chosenFlights";
import { FlightPicker } from "./FlightPicker";

/** The flights in the URL; a URL without flights restores those stored in this tab. */
function useChosen(): [number[], (trials: readonly number[]) => void] {
  const [params, setParams] = useSearchParams();
  const chosen = chosenIn(params);
  const choose = (trials: readonly number[]): void => {
    remember(trials);
    setParams(paramsOf(trials, params.get("campaign")), { replace: true });
  };
  useEffect(() => {
    const before = remembered();
    const named = chosenIn(params);
    if (named.length > 0) remember(named);
    else if (before.length > 0) setParams(paramsOf(before, params.get("campaign")), { replace: true });
  }, [params, setParams]);
  return [chosen, choose];
}

/** Comparison of any flights of any campaigns. */
export function ComparePage() {
  useTitle("Compare");
  const [params] = useSearchParams();
  const [from] = useState(Number(params.get("campaign")));
  const [chosen, choose] = useChosen();
  const comparison = useComparison(chosen);
  const problem = problemOf(comparison.error);
  const kept = withoutRefused(chosen, problem);
  return (
    <>
      <Group justify="space-between" gap={12} mb={14}>
        <Title order={1}>Compare</Title>
        {chosen.length > 0 && (
          <Button variant="default" onClick={() => choose([])}>
            Clear selection
          </Button>
        )}
      </Group>
      {/* The list of flights is below the comparison, or left of it where both have room. */}
      <Group align="start" gap="var(--gap)" style={{ flexDirection: "row-reverse" }}>
        <Stack gap="var(--gap)" miw={0} flex="999 1 700px">
          {chosen.length === 0 && (
            <section className={work["teach"]}>
              <p>
                <strong>Compare flights</strong> of one or more campaigns: which gains are better, with what confidence,
                and which settings differ.
              </p>
              <p>
                Select two or more flights. The first is the reference. To share the selection, copy the URL of this
                page.
              </p>
            </section>
          )}
          {chosen.length === 1 && <OnlyOne trialId={chosen[0] ?? 0} />}
          {problem !== null && chosen.length > kept.length && (
            <div>
              <FailureNotice
                reason={`These flights cannot be compared: ${problem.problems.map(({ reason }) => reason).join("; ")}.`}
              />
              <Button variant="default" mt={10} onClick={() => choose(kept)}>
                Remove {count(chosen.length - kept.length, "flight")}
              </Button>
            </div>
          )}
          {chosen.length > 1 && chosen.length === kept.length && <ErrorNotice error={problem} />}
          {comparison.data !== undefined && chosen.length > 1 && (
            <Compared comparison={comparison.data} trials={chosen} choose={choose} />
          )}
          {comparison.isPending && chosen.length > 1 && <div style={{ height: 480 }} aria-busy="true" />}
        </Stack>
        <Box flex="1 1 340px" miw={0}>
          <FlightPicker
            chosen={chosen}
            from={from > 0 ? from : null}
            onToggle={(trial) => choose(toggled(chosen, trial))}
          />
        </Box>
      </Group>
    </>
  );
}

function OnlyOne({ trialId }: { trialId: number }) {
  const trial = useTrial(trialId);
  if (trial.error) return <ErrorNotice error={trial.error} />;
  return (
    <section className={work["teach"]}>
      <p>{trial.data ? `Flight ${trial.data.number}` : "One flight"} is selected. Select at least one more.</p>
    </section>
  );
}

interface ComparedProps {
  comparison: FlightComparison;
  trials: readonly number[];
  choose: (trials: readonly number[]) => void;
}

function Compared({ comparison, trials, choose }: ComparedProps) {
  const figure = useComparisonFigure(trials);
  const pens = useMemo(() => lineStylesOf(figure.data), [figure.data]);
  const { verdict, sentence, notes, flights, pairs } = comparison;
  const { Icon } = VERDICTS[verdict ?? "unresolved"];
  const first = flights[0];
  const sentences = flights.flatMap(
    ({ trial_id }) => againstFirst(pairs, first?.trial_id ?? 0, trial_id)?.sentence ?? [],
  );
  return (
    <>
      <section aria-label="Verdict">
        <Aside tone={toneOf(verdict)} display="flex" style={{ gap: 10 }}>
          <Icon size={24} aria-hidden />
          <div role="status">
            <Text fz="strong" maw="90ch">
              {sentence}
            </Text>
            {notes.map((note) => (
              <Note key={note} mt={4} fz="body" maw="90ch">
                {note}
              </Note>
            ))}
          </div>
        </Aside>
      </section>
      <FigurePanel
        title="Curves"
        card={figure.data}
        error={figure.error}
        height={560}
        tools={<SaveComparison trials={trials} stem={comparison.file_stem} />}
      />
      <Panel title="Flights">
        <ComparisonTable
          comparison={comparison}
          pens={pens}
          onFirst={(trial) => choose([trial, ...trials.filter((one) => one !== trial)])}
          onRemove={(trial) => choose(trials.filter((one) => one !== trial))}
        />
        <SettingsTable comparison={comparison} />
        {sentences.length > 1 && first !== undefined && (
          <details>
            <summary>Comparisons with {first.label}</summary>
            <ul className={work["notes"]}>
              {sentences.map((one) => (
                <li key={one}>{one}</li>
              ))}
            </ul>
          </details>
        )}
      </Panel>
    </>
  );
}

type Format = "png" | "svg";

const SIZE = { width: 1280, height: 800 } as const;

/** Save the figure in the light theme on white, for documents. */
async function save(trials: readonly number[], filename: string, format: Format): Promise<void> {
  const { figure, reason } = await comparisonFigure(trials, "light");
  if (!figure) throw new Error(reason);
  const { data, layout } = figure as unknown as PlotlyFigure;
  const plotly = await loadPlotly();
  const onWhite = { ...layout, paper_bgcolor: "white", margin: { l: 70, r: 30, t: 30, b: 60 } };
  await plotly.downloadImage({ data, layout: onWhite }, { ...SIZE, format, filename, scale: format === "png" ? 2 : 1 });
}

/** Download of the curves as CSV and of the figure as an image. */
function SaveComparison({ trials, stem }: { trials: readonly number[]; stem: string }) {
  const saving = useMutation({ mutationFn: (format: Format) => save(trials, stem, format) });
  return (
    <Group gap={8}>
      <Button
        component="a"
        variant="default"
        aria-label="Curves as CSV"
        href={curvesCsv(trials)}
        download={`${stem}.csv`}
      >
        CSV
      </Button>
      {(["png", "svg"] as const).map((format) => (
        <Button
          key={format}
          variant="default"
          aria-label={`Figure as ${format.toUpperCase()}`}
          loading={saving.isPending && saving.variables === format}
          onClick={() => saving.mutate(format)}
        >
          {format.toUpperCase()}
        </Button>
      ))}
      <ErrorNotice error={saving.error} />
    </Group>
  );
}
