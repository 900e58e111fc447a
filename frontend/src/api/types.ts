/** The API's types under the names that pages use. */

export type {
  Campaign,
  CampaignState,
  CampaignSummary,
  Catalogue,
  DefinitionOutput as Definition,
  Explanation,
  FigureCard,
  FigureTable,
  GainInfo,
  Gate,
  NewCampaignInput as NewCampaign,
  NextFlight,
  PresetInfo,
  Proposal,
  Sort,
  SparkCurve,
  Trial,
  TrialState,
  Trouble,
  VehicleKindInfo,
} from "./generated";
