import { Anchor, Box, Button, Skeleton, Title } from "@mantine/core";
import { IconPin } from "@tabler/icons-react";
import { useCallback, useState } from "react";
import { Link, Redirect, useParams } from "wouter";
import { navigate } from "wouter/use-browser-location";
import { useCampaign, useFlightFigure, useTrial, useTrials } from "../../../api/queries";
import type { FigureCard } from "../../../api/types";
import { FigurePanel } from "../../../charts/FigurePanel";
import { grouped } from "../../../ui/format";
import { NotFound, NotFoundPage } from "../../../ui/NotFound";
import { useTitle } from "../../../ui/useTitle";
import page from "../CampaignPage.module.css";
import { GateChecks } from "../proposal/Gate";
import { VerdictPanel } from "../verdict/VerdictPanel";
import type { NotePin } from "./FlightNotes";
import { useFlightKeys } from "./useFlightKeys";

export function FlightPage() {
  const { campaignId, trialId } = useParams();
  const [campaign, trial] = [Number(campaignId), Number(trialId)];
  if (!Number.isInteger(campaign) || !Number.isInteger(trial)) return <NotFoundPage />;
  return <FlightById campaignId={campaign} trialId={trial} />;
}

const ALTITUDE_PX = 330;
const PANEL_PX = 125;
const WITHOUT_RECORD_PX = 96;

/** Room for the altitude and for each panel below it, or for the reason why there is no record. */
function recordHeight(card: FigureCard | undefined): number {
  if (card !== undefined && card.state !== "ready") return WITHOUT_RECORD_PX;
  const { meta } = (card?.figure?.["layout"] ?? {}) as { meta?: { panels?: number } };
  return ALTITUDE_PX + PANEL_PX * ((meta?.panels ?? 4) - 1);
}

/** One flight: its curve and commands, then its verdict. */
function FlightById({ campaignId, trialId }: { campaignId: number; trialId: number }) {
  const campaign = useCampaign(campaignId).data;
  const trial = useTrial(trialId);
  const trials = useTrials(campaignId).data ?? [];
  const figure = useFlightFigure(trialId);
  const hasSeed = campaign?.vehicle.can_fly && !campaign.vehicle.registered;
  const [pinning, setPinning] = useState(false);
  const [pin, setPin] = useState<NotePin | null>(null);
  const place = useCallback((timeS: number) => {
    setPin({ timeS });
    setPinning(false);
  }, []);
  useFlightKeys(trials, trialId, ({ id }) => navigate(`/campaigns/${campaignId}/flights/${id}`));
  useTitle(trial.data ? `Flight ${trial.data.number}` : "Flight");
  if (trial.error) return <NotFound error={trial.error} />;
  if (trial.data === undefined) return <Skeleton height={480} radius="md" />;
  const { campaign_id: own, number, record, gate } = trial.data;
  if (own !== campaignId) return <Redirect replace to={`/campaigns/${own}/flights/${trialId}`} />;
  return (
    <>
      <Anchor component={Link} to={`/campaigns/${campaignId}`} display="inline-block" py={4} fz="small">
        {campaign?.name ?? "Campaign"}
      </Anchor>
      <Title order={1} mb={12}>
        Flight {number}
      </Title>
      <div className={page["results"]}>
        <FigurePanel
          title="Record"
          card={figure.data}
          error={figure.error}
          height={recordHeight(figure.data)}
          tallest="400vw"
          onPlace={pinning ? place : undefined}
          tools={
            record !== null && (
              <Button
                variant={pinning ? "light" : "default"}
                aria-pressed={pinning}
                leftSection={<IconPin size={18} aria-hidden />}
                onClick={() => setPinning(!pinning)}
              >
                {pinning ? "Select a time in the chart" : "Pin note"}
              </Button>
            )
          }
        />
        <VerdictPanel trial={trial.data} trials={trials} pin={pin} />
        <Box px={18} py={4} c="dimmed" fz="small">
          {record !== null && (
            <p>
              {grouped(record.samples)} samples over {record.duration_s.toFixed(1)} s, source {record.source}, clock{" "}
              {record.clock}. Checksum <code>{record.checksum.slice(0, 12)}</code>
              {hasSeed && `, seed ${trial.data.seed}`}.
            </p>
          )}
          <GateChecks gate={gate} />
        </Box>
      </div>
    </>
  );
}
