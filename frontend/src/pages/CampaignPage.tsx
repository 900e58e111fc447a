import { SegmentedControl, Skeleton, useComputedColorScheme } from "@mantine/core";
import { useCallback, useState } from "react";
import { useParams } from "react-router";
import { useCampaign, useCampaignFigure, useProposal, useTrials } from "../api/queries";
import type { Campaign, Trial } from "../api/types";
import { CampaignHeader } from "../components/CampaignHeader";
import { FigurePanel } from "../components/FigurePanel";
import { Missing } from "../components/Missing";
import { NextFlightCard } from "../components/NextFlightCard";
import { Panel } from "../components/Panel";
import { StatisticsPanel } from "../components/StatisticsPanel";
import { TrialsTable } from "../components/TrialsTable";
import { Trouble } from "../components/Trouble";
import { useTitle } from "../components/useTitle";
import { useUnits } from "../components/useUnits";
import { VerdictPanel } from "../components/VerdictPanel";
import { type PlotlyFigure, withChosen, withTimeRange } from "../lib/traces";
import { shownTrial } from "../lib/verdict";
import classes from "./CampaignPage.module.css";
import { NotFoundPage } from "./NotFoundPage";

export function CampaignPage() {
  const campaignId = Number(useParams()["campaignId"]);
  return Number.isInteger(campaignId) ? <CampaignById key={campaignId} campaignId={campaignId} /> : <NotFoundPage />;
}

function CampaignById({ campaignId }: { campaignId: number }) {
  const campaign = useCampaign(campaignId);
  const trials = useTrials(campaignId);
  useTitle(campaign.data?.name ?? "Campaign");
  const error = campaign.error ?? trials.error;
  if (campaign.data && trials.data) return <CampaignView campaign={campaign.data} trials={trials.data} />;
  if (error) return <Missing error={error} />;
  return (
    <div aria-busy="true" className={classes["columns"]}>
      <Skeleton height={480} radius="md" />
      <Skeleton height={480} radius="md" />
    </div>
  );
}

/** Height of the lower charts: enough for a panel of each gain. */
const LOWER_PX = 300;
const PANEL_PX = 84;
const FIRST_SECONDS = [-0.3, 8] as const;

function useDressed(chosen: number | null, span: string): (figure: PlotlyFigure) => PlotlyFigure {
  return useCallback(
    (figure) => ({
      data: withChosen(figure.data, chosen),
      layout: withTimeRange(figure.layout, span === "first" ? FIRST_SECONDS : null),
    }),
    [chosen, span],
  );
}

function CampaignView({ campaign, trials }: { campaign: Campaign; trials: readonly Trial[] }) {
  const theme = useComputedColorScheme("light");
  const [chosen, setChosen] = useState<number | null>(null);
  const [span, setSpan] = useState("whole");
  const next = useProposal(campaign.id);
  const takeoffs = useCampaignFigure(campaign.id, "takeoffs", theme);
  const errors = useCampaignFigure(campaign.id, "errors", theme);
  const gains = useCampaignFigure(campaign.id, "gains", theme);
  const experiment = campaign.definition.experiment ?? "takeoff";
  const unit = useUnits(experiment).error;
  const lower = Math.max(LOWER_PX, PANEL_PX * Object.keys(trials[0]?.gains ?? {}).length);
  const shown = shownTrial(trials, chosen);
  const choose = useCallback((number: number) => setChosen((before) => (before === number ? null : number)), []);
  return (
    <>
      <p className="visually-hidden" role="status">
        {campaign.flying ? `Flight ${campaign.flying.trial_number} is under way.` : (trials.at(-1)?.verdict ?? "")}
      </p>
      <CampaignHeader campaign={campaign} />
      <div className={classes["columns"]} data-flying={campaign.flying !== null || undefined}>
        <div className={classes["flown"]}>
          <FigurePanel
            title={takeoffs.data?.title ?? "Curves"}
            card={takeoffs.data}
            error={takeoffs.error}
            height={440}
            topic="curves"
            dressed={useDressed(chosen, span)}
            liveTrial={campaign.flying?.trial_id ?? null}
            onChoose={choose}
            tools={
              <SegmentedControl
                aria-label="Time shown"
                size="sm"
                value={span}
                onChange={setSpan}
                data={[
                  { value: "first", label: "First 8 s" },
                  { value: "whole", label: "Whole flight" },
                ]}
              />
            }
          />
          {shown !== null && (
            <VerdictPanel
              trial={shown}
              trials={trials}
              isBest={shown.id === campaign.best?.trial_id}
              unit={unit}
              experiment={experiment}
            />
          )}
        </div>
        <div className={classes["next"]}>
          {next.data ? (
            <NextFlightCard campaign={campaign} next={next.data} trials={trials} onChoose={setChosen} />
          ) : (
            <Trouble error={next.error} />
          )}
        </div>
      </div>
      <div className={classes["halves"]}>
        <FigurePanel
          title="Error per flight"
          card={errors.data}
          error={errors.error}
          height={lower}
          topic="threshold"
          onChoose={choose}
        />
        <FigurePanel title="Gains per flight" card={gains.data} error={gains.error} height={lower} />
      </div>
      <div className={classes["row"]}>
        <StatisticsPanel campaignId={campaign.id} />
      </div>
      <Panel title="All flights" className={classes["row"]}>
        {trials.length === 0 ? (
          <p className={classes["none"]}>
            Nothing has flown yet. The first flight will stand here with its gains and error.
          </p>
        ) : (
          <TrialsTable
            campaign={campaign}
            trials={trials}
            shown={shown?.number ?? null}
            unit={unit}
            onChoose={choose}
          />
        )}
      </Panel>
    </>
  );
}
