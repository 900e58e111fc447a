/** The charts of a campaign. Each keeps its own state, so that the page is not rendered again for it. */

import { SegmentedControl } from "@mantine/core";
import { useDebouncedValue } from "@mantine/hooks";
import { memo, useCallback, useDeferredValue, useMemo, useState } from "react";
import { type TimeRange, useCampaignFigure, useCurveOf } from "../../api/queries";
import type { Campaign, Trial } from "../../api/types";
import { FigurePanel } from "../../charts/FigurePanel";
import { type NextFlight, withNextError, withNextGains } from "../../charts/nextFlight";
import { openingTitle, type PlotlyFigure, wholeFlight, withChosen, withTimeRange } from "../../charts/traces";
import classes from "./CampaignPage.module.css";
import type { Preview } from "./proposal/useChosenFlight";

/** Height of the lower charts: enough for a panel of each gain. */
const LOWER_PX = 300;
const PANEL_PX = 84;
/** For more flights the server draws an envelope, and one flight's curve on request. */
const EACH_DRAWN = 30;

/** The server's figure opens at the first 8 s. */
type Span = "first" | "whole";

interface CurvesProps {
  campaign: Campaign;
  trials: readonly Trial[];
  chosen: number | null;
  /** The prediction of the gains that are chosen for the next flight; null for the proposal's. */
  preview: Preview | null;
  onChoose: (trialNumber: number) => void;
}

/** The curves of all flights with the set point and the next prediction. */
export const CurvesPanel = memo(function CurvesPanel({ campaign, trials, chosen, preview, onChoose }: CurvesProps) {
  const [picked, setPicked] = useState<Span>("first");
  const chosenSpan = campaign.flying === null ? picked : "whole";
  const span = useDeferredValue(chosenSpan);
  const [zoom, setZoom] = useState<TimeRange | null>(null);
  const [whole, setWhole] = useState<TimeRange | null>(null);
  const takeoffs = useCampaignFigure(campaign.id, "takeoffs", {
    window: zoom ?? (span === "whole" ? whole : null),
    flight: campaign.trials.flown > EACH_DRAWN ? chosen : null,
  });
  const curveOf = useCurveOf(trials, campaign.definition.experiment);
  const figure = takeoffs.data?.figure as unknown as PlotlyFigure | null | undefined;
  const known = figure ? wholeFlight(figure) : null;
  if (known !== null && known.join() !== whole?.join()) setWhole(known);
  const pick = useCallback((value: Span): void => {
    setPicked(value);
    setZoom(null);
  }, []);
  const showAll = useCallback(() => pick("whole"), [pick]);
  const dressed = useCallback(
    (raw: PlotlyFigure) => ({
      data: withChosen(raw.data, chosen),
      layout: withTimeRange(raw.layout, span === "whole" ? wholeFlight(raw) : null),
    }),
    [chosen, span],
  );
  return (
    <FigurePanel
      title={takeoffs.data?.title ?? "Curves"}
      card={takeoffs.data}
      error={takeoffs.error}
      height={440}
      topic="curves"
      dressed={dressed}
      prediction={preview?.prediction ?? null}
      className={`${classes["curves"]} ${preview?.isCurrent === false ? classes["outdated"] : ""}`}
      liveTrial={campaign.flying?.trial_id ?? null}
      onChoose={onChoose}
      onWindow={setZoom}
      onReset={showAll}
      curveOf={curveOf}
      tools={
        <SegmentedControl
          aria-label="Time range"
          size="sm"
          value={chosenSpan}
          disabled={campaign.flying !== null}
          onChange={pick}
          data={[
            { value: "first", label: (figure && openingTitle(figure)) ?? "First 8 s" },
            { value: "whole", label: "Whole flight" },
          ]}
        />
      }
    />
  );
});

interface ByFlightProps {
  campaignId: number;
  preview: Preview | null;
  onChoose: (trialNumber: number) => void;
}

/** These charts are drawn again once the gains are at rest, so that the curve follows without delay. */
const AT_REST_MS = 200;
/** For a prediction so long; the marks of the gains before stay meanwhile. */
const WAITS_MS = 1500;

function nextOf({ gains, prediction, isCurrent }: Preview): NextFlight {
  const known = isCurrent ? prediction : null;
  return { gains, predictedError: known?.predicted_error ?? null, interval: known?.interval ?? null };
}

/** Changes a figure for the gains that are chosen; undefined for the proposed ones. */
function useNext(
  preview: Preview | null,
  change: (figure: PlotlyFigure, next: NextFlight) => PlotlyFigure,
): ((figure: PlotlyFigure) => PlotlyFigure) | undefined {
  return useMemo(() => (preview === null ? undefined : (figure) => change(figure, nextOf(preview))), [preview, change]);
}

/** Error and gains per flight. */
export const ByFlightPanels = memo(function ByFlightPanels({ campaignId, preview, onChoose }: ByFlightProps) {
  const errors = useCampaignFigure(campaignId, "errors");
  const gains = useCampaignFigure(campaignId, "gains");
  const [rested] = useDebouncedValue(preview, preview?.isCurrent === false ? WAITS_MS : AT_REST_MS);
  const height = Math.max(LOWER_PX, PANEL_PX * ((gains.data?.table?.columns.length ?? 1) - 1));
  return (
    <>
      <FigurePanel
        title="Error per flight"
        card={errors.data}
        error={errors.error}
        height={height}
        topic="threshold"
        dressed={useNext(rested, withNextError)}
        onChoose={onChoose}
      />
      <FigurePanel
        title="Gains per flight"
        card={gains.data}
        error={gains.error}
        height={height}
        dressed={useNext(rested, withNextGains)}
        onChoose={onChoose}
      />
    </>
  );
});
