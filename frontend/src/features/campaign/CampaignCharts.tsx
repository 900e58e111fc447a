/** The charts of a campaign. Each keeps its own state, so that the page is not rendered again for it. */

import { SegmentedControl, useComputedColorScheme } from "@mantine/core";
import { memo, useCallback, useDeferredValue, useState } from "react";
import type { TimeRange } from "../../api/queries";
import { useCampaignFigure, useCurveOf } from "../../api/queries";
import type { Campaign, Trial } from "../../api/types";
import { FigurePanel } from "../../charts/FigurePanel";
import { type PlotlyFigure, withChosen, withTimeRange } from "../../charts/traces";

/** Height of the lower charts: enough for a panel of each gain. */
const LOWER_PX = 300;
const PANEL_PX = 84;
const FIRST_SECONDS = [-0.3, 8] as const;
/** For more flights the server draws an envelope, and one flight's curve on request. */
const EACH_DRAWN = 30;

function useDressed(chosen: number | null, span: string): (figure: PlotlyFigure) => PlotlyFigure {
  return useCallback(
    (figure) => ({
      data: withChosen(figure.data, chosen),
      layout: withTimeRange(figure.layout, span === "first" ? FIRST_SECONDS : null),
    }),
    [chosen, span],
  );
}

interface CurvesProps {
  campaign: Campaign;
  trials: readonly Trial[];
  chosen: number | null;
  onChoose: (trialNumber: number) => void;
}

/** The curves of all flights with the set point and the next prediction. */
export const CurvesPanel = memo(function CurvesPanel({ campaign, trials, chosen, onChoose }: CurvesProps) {
  const theme = useComputedColorScheme("light");
  const [picked, setPicked] = useState("whole");
  const span = useDeferredValue(picked);
  const [zoom, setZoom] = useState<TimeRange | null>(null);
  const takeoffs = useCampaignFigure(campaign.id, "takeoffs", theme, {
    window: zoom ?? (span === "first" ? FIRST_SECONDS : null),
    flight: campaign.trials.flown > EACH_DRAWN ? chosen : null,
  });
  const curveOf = useCurveOf(trials, campaign.definition.experiment ?? "takeoff");
  const pick = (value: string): void => {
    setPicked(value);
    setZoom(null);
  };
  return (
    <FigurePanel
      title={takeoffs.data?.title ?? "Curves"}
      card={takeoffs.data}
      error={takeoffs.error}
      height={440}
      topic="curves"
      dressed={useDressed(chosen, span)}
      liveTrial={campaign.flying?.trial_id ?? null}
      onChoose={onChoose}
      onWindow={setZoom}
      curveOf={curveOf}
      tools={
        <SegmentedControl
          aria-label="Time shown"
          size="sm"
          value={picked}
          onChange={pick}
          data={[
            { value: "first", label: "First 8 s" },
            { value: "whole", label: "Whole flight" },
          ]}
        />
      }
    />
  );
});

interface ByFlightProps {
  campaignId: number;
  onChoose: (trialNumber: number) => void;
}

/** Error and gains per flight. */
export const ByFlightPanels = memo(function ByFlightPanels({ campaignId, onChoose }: ByFlightProps) {
  const theme = useComputedColorScheme("light");
  const errors = useCampaignFigure(campaignId, "errors", theme);
  const gains = useCampaignFigure(campaignId, "gains", theme);
  const height = Math.max(LOWER_PX, PANEL_PX * ((gains.data?.table?.columns.length ?? 1) - 1));
  return (
    <>
      <FigurePanel
        title="Error per flight"
        card={errors.data}
        error={errors.error}
        height={height}
        topic="threshold"
        onChoose={onChoose}
      />
      <FigurePanel title="Gains per flight" card={gains.data} error={gains.error} height={height} onChoose={onChoose} />
    </>
  );
});
