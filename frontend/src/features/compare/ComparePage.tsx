import { Button, useComputedColorScheme } from "@mantine/core";
import { IconCircleArrowDown, IconCircleArrowUp, IconHelpHexagon } from "@tabler/icons-react";
import { useEffect, useMemo, useState } from "react";
import { useSearchParams } from "react-router";
import { type FlightComparison, useComparison, useComparisonFigure } from "../../api/compare";
import { problemOf } from "../../api/problems";
import { useTrial } from "../../api/queries";
import { FigurePanel } from "../../charts/FigurePanel";
import { ErrorNotice } from "../../ui/ErrorNotice";
import work from "../../ui/Page.module.css";
import { Panel } from "../../ui/Panel";
import { useTitle } from "../../ui/useTitle";
import classes from "./Compare.module.css";
import { ComparisonTable, SettingsTable } from "./ComparisonTable";
import { againstFirst, chosenIn, paramsOf, remember, remembered, toggled, withoutRefused } from "./chosenFlights";
import { FlightPicker } from "./FlightPicker";
import { lineStylesOf } from "./LineSample";
import { SaveComparison } from "./SaveComparison";

/** The flights of the address. `add` takes one in beside those that this tab remembers; a bare address brings them
 * back. */
function useChosen(): [number[], (trials: readonly number[]) => void] {
  const [params, setParams] = useSearchParams();
  const chosen = chosenIn(params);
  const choose = (trials: readonly number[]): void => {
    remember(trials);
    setParams(paramsOf(trials), { replace: true });
  };
  useEffect(() => {
    const added = Number(params.get("add"));
    const before = remembered();
    const named = chosenIn(params);
    if (named.length > 0) remember(named);
    else if (added > 0 || before.length > 0) {
      setParams(paramsOf(added > 0 && !before.includes(added) ? [...before, added] : before), { replace: true });
    }
  }, [params, setParams]);
  return [chosen, choose];
}

/** Any flights of any campaigns side by side. */
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
      <div className={work["head"]}>
        <h1 className={work["title"]}>Compare</h1>
        {chosen.length > 0 && (
          <Button variant="default" onClick={() => choose([])}>
            Start over
          </Button>
        )}
      </div>
      <div className={classes["stack"]}>
        {chosen.length === 0 && <Teaching />}
        {chosen.length === 1 && <OnlyOne trialId={chosen[0] ?? 0} />}
        {problem !== null && chosen.length > 1 && (
          <div>
            <ErrorNotice error={comparison.error} />
            {kept.length < chosen.length && (
              <Button variant="default" mt={10} onClick={() => choose(kept)}>
                Leave {chosen.length - kept.length === 1 ? "it" : "them"} out
              </Button>
            )}
          </div>
        )}
        {comparison.data !== undefined && chosen.length > 1 && (
          <Compared comparison={comparison.data} trials={chosen} choose={choose} />
        )}
        {comparison.isPending && chosen.length > 1 && <div style={{ height: 480 }} aria-busy="true" />}
        <FlightPicker
          chosen={chosen}
          from={from > 0 ? from : null}
          onToggle={(trial) => choose(toggled(chosen, trial))}
        />
      </div>
    </>
  );
}

function Teaching() {
  return (
    <section className={work["teach"]}>
      <p>
        <strong>Lay flights over each other</strong>, of one campaign or of several: which gains are better, how sure
        that is, and what else was not the same.
      </p>
      <p>
        Tick two or more below. The first one is what the others are held against. The address of this page holds the
        choice, so that it can be sent to somebody.
      </p>
    </section>
  );
}

function OnlyOne({ trialId }: { trialId: number }) {
  const trial = useTrial(trialId);
  if (trial.error) return <ErrorNotice error={trial.error} />;
  return (
    <section className={work["teach"]}>
      <p>
        {trial.data ? `Flight ${trial.data.number}` : "One flight"} is chosen. Tick at least one more to compare it
        with.
      </p>
    </section>
  );
}

const ICONS = {
  better: IconCircleArrowDown,
  worse: IconCircleArrowUp,
  unresolved: IconHelpHexagon,
  "not known yet": IconHelpHexagon,
} as const;

interface ComparedProps {
  comparison: FlightComparison;
  trials: readonly number[];
  choose: (trials: readonly number[]) => void;
}

function Compared({ comparison, trials, choose }: ComparedProps) {
  const figure = useComparisonFigure(trials, useComputedColorScheme("light"));
  const pens = useMemo(() => lineStylesOf(figure.data), [figure.data]);
  const { verdict, sentence, notes, flights, pairs } = comparison;
  const Icon = ICONS[verdict ?? "unresolved"];
  const first = flights[0];
  const said = flights.flatMap(({ trial_id }) => againstFirst(pairs, first?.trial_id ?? 0, trial_id)?.sentence ?? []);
  return (
    <>
      <section className={classes["verdict"]} data-verdict={verdict ?? undefined} aria-label="Verdict">
        <Icon size={24} aria-hidden />
        <div role="status">
          <p>{sentence}</p>
          {notes.map((note) => (
            <p key={note}>{note}</p>
          ))}
        </div>
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
        {said.length > 1 && first !== undefined && (
          <details className={classes["words"]}>
            <summary>Each against {first.label} in words</summary>
            <ul>
              {said.map((one) => (
                <li key={one}>{one}</li>
              ))}
            </ul>
          </details>
        )}
      </Panel>
    </>
  );
}
