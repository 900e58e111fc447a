import { Button, Group, Loader, Stack, Text } from "@mantine/core";
import { useRecompute, useUploadRecord } from "../../../api/mutations";
import { localProblem } from "../../../api/problems";
import { useCampaign } from "../../../api/queries";
import type { Trouble } from "../../../api/types";
import { ErrorNotice } from "../../../ui/Notices";
import { Panel } from "../../../ui/Panel";
import { ProposalCard } from "../proposal/ProposalCard";
import type { ShowPreview } from "../proposal/useChosenFlight";
import type { CampaignStatus } from "../useCampaignStatus";
import { FinishedCard } from "./FinishedCard";
import { FlyingCard } from "./FlyingCard";
import { nextStep } from "./nextStep";
import { PlannedCard } from "./PlannedCard";
import { RehearsalCard, RehearsalNote } from "./RehearsalCard";

interface Props extends CampaignStatus {
  onChoose: (trialNumber: number) => void;
  onPreview: ShowPreview;
  /** Shows the review of a flight. */
  onReview: (trialNumber: number) => void;
}

/** The next action of the campaign, in every state. */
export function NextFlightCard(props: Props) {
  const { rehearses } = props.campaign;
  return rehearses === null ? <Step {...props} /> : <RehearsalStep {...props} rehearses={rehearses} />;
}

/** Once the rehearsal has passed, the next action is the real campaign. */
function RehearsalStep({ rehearses, ...props }: Props & { rehearses: number }) {
  const real = useCampaign(rehearses).data;
  return (
    <>
      {real !== undefined && <RehearsalNote real={real} />}
      <Step {...props} isSecondary={real?.rehearsal.state === "passed"} />
    </>
  );
}

function Step(props: Props & { isSecondary?: boolean }) {
  const { campaign, next, trials, onChoose, onPreview, onReview, isSecondary = false } = props;
  const step = nextStep(campaign, next, trials);
  // Kept here, so that the error of a refused record is still shown when its trial becomes a planned one.
  const upload = useUploadRecord(campaign.id);
  switch (step.kind) {
    case "flying":
      return <FlyingCard campaign={campaign} trials={trials} flight={step.flight} />;
    case "finished":
      return <FinishedCard campaign={campaign} onChoose={onChoose} isSecondary={isSecondary} />;
    case "rehearse":
      return <RehearsalCard campaign={campaign} />;
    case "planned":
      return <PlannedCard campaign={campaign} trial={step.trial} upload={upload} />;
    case "propose":
      return (
        <ProposalCard
          key={step.proposal.id}
          campaign={campaign}
          proposal={step.proposal}
          trials={trials}
          upload={upload}
          onPreview={onPreview}
          isSecondary={isSecondary}
        />
      );
    case "judge":
      return (
        <Panel title={`Flight ${step.trial.number} needs review`}>
          <Text lh={1.45} mb={14}>
            {step.trial.state === "lost"
              ? "How this flight ended is unknown. The next gains are proposed after you review it."
              : "The next gains are proposed after you review this flight."}
          </Text>
          <Button fullWidth onClick={() => onReview(step.trial.number)}>
            Review flight {step.trial.number}
          </Button>
        </Panel>
      );
    case "failed":
      return <FailedCard campaignId={campaign.id} problem={step.problem} />;
    case "computing":
      return (
        <Panel title="Next flight">
          <Group wrap="nowrap" mih={160} lh={1.45} role="status">
            <Loader size="md" aria-hidden />
            <p>
              <strong>Computing the next gains</strong>
              <br />
              from {trials.length === 0 ? "the start settings" : "all flights so far"}. This takes about a second.
            </p>
          </Group>
        </Panel>
      );
  }
}

function FailedCard({ campaignId, problem }: { campaignId: number; problem: Trouble | null }) {
  const { title = "The next gains could not be computed.", detail, hint } = problem ?? {};
  const recompute = useRecompute(campaignId);
  return (
    <Panel title="Next flight">
      <Stack gap={14}>
        <ErrorNotice error={localProblem(title, detail, hint)} />
        <Button loading={recompute.isPending} onClick={() => recompute.mutate()}>
          Compute again
        </Button>
        <ErrorNotice error={recompute.error} />
      </Stack>
    </Panel>
  );
}
